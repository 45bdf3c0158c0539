// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "src/gl/event_list.hpp"
#include "src/gl/objects.hpp"
#include "src/simulate/simulator.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera::gl {

/// Computes the luma of textures, exactly as luma_of_rgb() and composite_on_black() do.
class LumaKernel {
 public:
  explicit LumaKernel(const Context& gl);
  void run(const TextureFrame& frame, const GreyFrame& out) const;

 private:
  const Context& gl_;
  Kernel kernel_;
};

/// Number of steps that a kernel with a word per pixel and step processes at once, at most `steps`:
/// OpenGL ES guarantees buffers of 128 MiB.
inline int steps_at_once(const LumaFormat& format, int steps) {
  constexpr std::size_t max_words = std::size_t{1} << 25;
  return std::clamp(static_cast<int>(max_words / pixel_count(format)), 1, steps);
}

/// Marks the pixels that fire between two frames, like fire_differences().
class DifferenceKernel {
 public:
  DifferenceKernel(const Context& gl, const LumaFormat& format);

  /// Writes the marks of `step`, 1 or later.
  void run(const GreyFrame& before, const GreyFrame& now, const Thresholds& thresholds, int step,
           const EventList& out) const;

  /// Writes the marks of the steps [first, end). The frame after step j is number j % `ring_size`
  /// in `frames`.
  void run(const Buffer& frames, int ring_size, const Thresholds& thresholds, int first, int end,
           const EventList& out) const;

 private:
  LumaFormat format_;
  Kernel kernel_;
};

/// Marks the pixels that fire in the frames interpolated between two frames, like
/// eventcamera::InterpolationKernel; the same flow gives the same events.
class InterpolationKernel {
 public:
  InterpolationKernel(const Context& gl, const LumaFormat& format);

  /// Writes the marks of all steps of an interval. `flow` is laid out as by FarnebackFlow.
  void run(const GreyFrame& last, const GreyFrame& now, const Buffer& flow,
           Interpolation interpolation, const Thresholds& thresholds, const EventList& out) const;

 private:
  LumaFormat format_;
  Kernel kernel_;
};

/// A 2D texture of RGBA bytes to draw events in, and the colours of pixels without events, with
/// OFF, with ON, and with both.
struct Picture {
  GLuint texture;
  std::array<std::array<std::uint8_t, 4>, 4> colours;
};

/// Draws the marks of an event list like Accumulator draws events, without counting or sorting.
class DrawKernel {
 public:
  DrawKernel(const Context& gl, const LumaFormat& format);
  void run(const EventList& events, const Picture& out);

 private:
  const Context& gl_;
  LumaFormat format_;
  Kernel kernel_;
  /// Output of the shader, copied to the texture on the GPU: shaders of OpenGL ES 3.1 can write
  /// only to immutable textures, but GStreamer's are mutable.
  Buffer pixels_;
};

}  // namespace eventcamera::gl
