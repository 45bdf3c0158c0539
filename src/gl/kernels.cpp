// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/kernels.hpp"

#include <algorithm>
#include <bit>

#include "src/gl/shaders.hpp"

namespace eventcamera::gl {

LumaKernel::LumaKernel(const Context& gl) : gl_(gl), kernel_(gl, "luma", shaders::luma) {}

void LumaKernel::run(const TextureFrame& frame, const GreyFrame& out) const {
  const auto& [width, height, bits] = frame.format;
  const int words = GreyFrame::words_across(width);
  gl_.ActiveTexture(GL_TEXTURE0);
  gl_.BindTexture(GL_TEXTURE_2D, frame.texture);
  kernel_.run({groups_of(64, words), height}, {&out.buffer()},
              {width, words, frame.weights[0], frame.weights[1], frame.weights[2], frame.weights[3],
               frame.alpha, frame.black});
  gl_.BindTexture(GL_TEXTURE_2D, 0);
}

DifferenceKernel::DifferenceKernel(const Context& gl, const LumaFormat& format)
    : format_(format), kernel_(gl, "difference", shaders::difference) {}

void DifferenceKernel::run(const GreyFrame& before, const GreyFrame& now,
                           const Thresholds& thresholds, int step, const EventList& out) const {
  const int words = GreyFrame::words_across(format_.width);
  kernel_.run({groups_of(64, words), format_.height},
              {&before.buffer(), &now.buffer(), &out.marks()},
              {format_.width, words, out.marks_across(), (step - 1) * out.marks_a_step(),
               thresholds.positive, thresholds.negative, 0, 1});
}

void DifferenceKernel::run(const Buffer& frames, int ring_size, const Thresholds& thresholds,
                           int first, int end, const EventList& out) const {
  const int words = GreyFrame::words_across(format_.width);
  kernel_.run({groups_of(64, words), format_.height, end - first}, {&frames, &frames, &out.marks()},
              {format_.width, words, out.marks_across(), (first - 1) * out.marks_a_step(),
               thresholds.positive, thresholds.negative, first - 1, ring_size});
}

InterpolationKernel::InterpolationKernel(const Context& gl, const LumaFormat& format)
    : format_(format), kernel_(gl, "interpolate", shaders::interpolate) {}

void InterpolationKernel::run(const GreyFrame& last, const GreyFrame& now, const Buffer& flow,
                              Interpolation interpolation, const Thresholds& thresholds,
                              const EventList& out) const {
  const int steps = out.steps();
  constexpr int max_steps = 64;  // per run, as in the shader
  const int factor = std::bit_cast<int>(65536.0F / static_cast<float>(steps));
  for (int first = 1; first <= steps; first += max_steps)
    kernel_.run({groups_of(64, format_.width), format_.height},
                {&last.buffer(), &now.buffer(), &flow, &out.marks()},
                {format_.width, format_.height, interpolation == Interpolation::blend ? 1 : 0,
                 steps, factor, first, std::min(first + max_steps - 1, steps), thresholds.positive,
                 thresholds.negative});
}

DrawKernel::DrawKernel(const Context& gl, const LumaFormat& format)
    : gl_(gl), format_(format), kernel_(gl, "draw", shaders::draw), pixels_(gl) {}

void DrawKernel::run(const EventList& events, const Picture& out) {
  const auto [width, height, bits] = format_;
  const auto colour = [&out](std::size_t kind) { return std::bit_cast<int>(out.colours[kind]); };
  pixels_.reserve(pixel_count(format_) * 4);
  kernel_.run(
      {groups_of(64, events.marks_across()), height}, {&events.marks(), &pixels_},
      {width, events.marks_across(), events.steps(), colour(0), colour(1), colour(2), colour(3)});

  gl_.MemoryBarrier(GL_PIXEL_BUFFER_BARRIER_BIT);
  gl_.BindBuffer(GL_PIXEL_UNPACK_BUFFER, pixels_.name());
  gl_.ActiveTexture(GL_TEXTURE0);
  gl_.BindTexture(GL_TEXTURE_2D, out.texture);
  gl_.TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
  gl_.BindTexture(GL_TEXTURE_2D, 0);
  gl_.BindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
}

}  // namespace eventcamera::gl
