// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>

#include "src/core/event_buckets.hpp"
#include "src/core/luma.hpp"
#include "src/gl/kernel.hpp"

namespace eventcamera::gl {

/// Collects the pixels that fire in each step of an interval, and reads them back as a sorted list
/// of events.
///
/// Kernels mark pixels in marks(): two words for 32 pixels of a row, whose bits are set for pixels
/// that fire and for those of them that become brighter; by step, then in raster order.
class EventList {
 public:
  EventList(const Context& gl, const LumaFormat& format);

  /// Begins an interval of this many steps: all of their marks must be written.
  void begin(int steps);

  const Buffer& marks() const { return marks_; }
  int marks_across() const { return marks_across_; }
  int marks_a_step() const { return marks_across_ * height_; }

  /// Waits for the GPU, and replaces the contents of `events`. `times` are those of the steps,
  /// microseconds. Throws Error.
  void read(std::span<const std::uint32_t> times, EventBuckets& events);

 private:
  void write(int steps) const;

  const Context& gl_;
  int marks_across_;
  int height_;
  Kernel count_;
  Kernel scan_;
  Kernel write_;
  Buffer marks_;
  Buffer starts_;  ///< index of the first event of each block of marks
  Buffer times_;
  Buffer total_;
  Buffer events_;
};

}  // namespace eventcamera::gl
