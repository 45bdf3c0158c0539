// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>

#include "src/core/luma.hpp"
#include "src/gl/event_list.hpp"

namespace eventcamera::gl {

/// A 2D texture of RGBA bytes that events are drawn in, and the colours of pixels without events,
/// with OFF, with ON, and with both.
struct Picture {
  GLuint texture;
  std::array<std::array<std::uint8_t, 4>, 4> colours;
};

/// Draws the marks of an event list, as Accumulator does its events. Drawn as they are, marks need
/// neither be counted nor sorted.
class DrawKernel {
 public:
  DrawKernel(const Context& gl, const LumaFormat& format);
  void run(const EventList& events, const Picture& out);

 private:
  const Context& gl_;
  LumaFormat format_;
  Kernel kernel_;
  /// OpenGL ES 3.1 lets shaders write to no texture that GStreamer makes: they are mutable. Copied
  /// to the texture on the GPU.
  Buffer pixels_;
};

}  // namespace eventcamera::gl
