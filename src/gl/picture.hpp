// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>

#include "src/core/luma.hpp"
#include "src/gl/event_list.hpp"

namespace eventcamera::gl {

/// A 2D texture of RGBA bytes to draw events in, and the colours of pixels without events, with
/// OFF, with ON, and with both.
struct Picture {
  GLuint texture;
  std::array<std::array<std::uint8_t, 4>, 4> colours;
};

/// Draws the marks of an event list like Accumulator draws events. For this, marks need neither be
/// counted nor sorted.
class DrawKernel {
 public:
  DrawKernel(const Context& gl, const LumaFormat& format);
  void run(const EventList& events, const Picture& out);

 private:
  const Context& gl_;
  LumaFormat format_;
  Kernel kernel_;
  /// Output of the shader, copied to the texture on the GPU: in OpenGL ES 3.1, shaders can only
  /// write to immutable textures, but GStreamer's textures are mutable.
  Buffer pixels_;
};

}  // namespace eventcamera::gl
