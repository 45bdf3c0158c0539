// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/gl/picture.hpp"

#include <bit>

#include "src/gl/grey_frame.hpp"
#include "src/gl/shaders.hpp"

namespace eventcamera::gl {

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
