// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/farneback.hpp"

#include <span>

#include "src/flow/farneback/farneback.hpp"
#include "src/gl/shaders.hpp"

namespace eventcamera::gl {
namespace {

constexpr std::size_t polynomial_size = PolynomialExpansion::coefficients * sizeof(float);
constexpr std::size_t equations_size = FlowUpdate::equations * sizeof(float);

/// Number of pixels in the rows for which flow is found.
std::size_t found_pixels(int width, int height) {
  return pixel_count({width, FlowUpdate::rows(height)});
}

}  // namespace

FarnebackFlow::Level::Level(const Context& gl, const LumaFormat& format, int level)
    : pyramid(format.width, format.height, level),
      width(pyramid.width()),
      height(pyramid.height()),
      blur(gl),
      polynomials{Buffer(gl), Buffer(gl)},
      flow(gl) {
  blur.assign(std::as_bytes(std::span(pyramid.kernel())));
  for (auto& of_picture : polynomials)
    of_picture.reserve(pixel_count({width, height}) * polynomial_size);
  flow.reserve(found_pixels(width, height) * sizeof(Flow));
}

FarnebackFlow::FarnebackFlow(const Context& gl, const LumaFormat& format)
    : format_(format),
      shrink_(gl, "shrink", shaders::shrink),
      expand_(gl, "expand", shaders::expand),
      upsample_(gl, "upsample", shaders::upsample),
      equations_(gl, "equations", shaders::equations),
      solve_(gl, "solve", shaders::solve),
      fit_(gl),
      no_flow_(gl),
      shrunk_(gl),
      equations_of_pixels_(gl),
      flow_(gl) {
  const int levels = eventcamera::FarnebackFlow::level_count(format.width, format.height);
  for (int level = 0; level < levels; ++level) levels_.emplace_back(gl, format, level);
  const FitKernels kernels;
  fit_.assign(std::as_bytes(std::span(&kernels, 1)));
  no_flow_.assign_zeros(levels_.back().flow.size());
  shrunk_.reserve(pixel_count(format) * sizeof(float));
  equations_of_pixels_.reserve(found_pixels(format.width, format.height) * equations_size);
  flow_.reserve(pixel_count(format) * sizeof(Flow));
}

void FarnebackFlow::push(const GreyFrame& picture) {
  last_ = 1 - last_;
  for (const auto& [pyramid, width, height, blur, polynomials, flow] : levels_) {
    shrink_.run({groups_of(64, width), height}, {&picture.buffer(), &blur, &shrunk_},
                {format_.width, format_.height, width, height,
                 static_cast<int>(pyramid.kernel().size() / 2)});
    expand_.run({groups_of(32, width), groups_of(4, height)},
                {&shrunk_, &fit_, &polynomials[last_]}, {width, height});
  }
}

const Buffer& FarnebackFlow::find() const {
  const Level* coarser = nullptr;
  int index = static_cast<int>(levels_.size());
  for (auto level = levels_.rbegin(); level != levels_.rend(); ++level) {
    const auto& [pyramid, width, height, blur, polynomials, flow] = *level;
    const int rows = FlowUpdate::rows(height);
    const int groups = groups_of(64, width);
    if (coarser != nullptr)
      upsample_.run({groups, rows}, {&coarser->flow, &flow},
                    {coarser->width, coarser->height, width, height, FlowUpdate::row_step, 2});
    const Buffer* before = coarser != nullptr ? &flow : &no_flow_;
    const int iterations = eventcamera::FarnebackFlow::iterations[--index];
    for (int i = 0; i < iterations; ++i) {
      equations_.run({groups, rows},
                     {&polynomials[1 - last_], &polynomials[last_], before, &equations_of_pixels_},
                     {width, height});
      solve_.run({groups, groups_of(4, rows)}, {&equations_of_pixels_, &flow}, {width, rows});
      before = &flow;
    }
    coarser = &*level;
  }
  const auto& finest = levels_.front();
  upsample_.run({groups_of(64, finest.width), finest.height}, {&finest.flow, &flow_},
                {finest.width, finest.height, finest.width, finest.height, 1, 1});
  return flow_;
}

}  // namespace eventcamera::gl
