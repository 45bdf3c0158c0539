// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/core/event_buckets.hpp"
#include "src/core/luma.hpp"
#include "src/gl/objects.hpp"
#include "src/simulate/simulator.hpp"

namespace eventcamera::gl {

/// Kernels that turn marks into a sorted list.
struct EventListKernels {
  explicit EventListKernels(const Context& gl);

  Kernel count;
  Kernel scan;
  Kernel write;
};

/// Collects the pixels that fire in the steps of an interval, and reads them back as a sorted list
/// of events. Each interval has its own list, so that the GPU can work on the next one meanwhile.
///
/// Kernels write marks(), by step, then in raster order: two words for 32 pixels of a row, with a
/// bit for each pixel that fires in the first, and for each that fires ON in the second.
class EventList {
 public:
  EventList(const Context& gl, const LumaFormat& format, const EventListKernels& kernels);

  /// Begins an interval without steps.
  void clear() { times_.clear(); }

  /// Begins an interval; then all marks of its steps, from `first` on, must be written.
  void begin(const StepTimes& steps, int first = 1);

  /// Marks events regardless of their times, OFF and ON in a step each.
  void assign(const EventBuckets& events);

  int steps() const { return static_cast<int>(times_.size()); }
  const Buffer& marks() const { return marks_; }
  int marks_across() const { return marks_across_; }
  int marks_a_step() const { return marks_across_ * height_; }

  /// Queues the sorting of the marks. Does not wait.
  void sort();

  /// Waits until the GPU has sorted the marks, and replaces the contents of `events`. Throws Error.
  void read(StepBuckets& events);

 private:
  void write() const;

  const Context& gl_;
  const EventListKernels& kernels_;
  int marks_across_;
  int height_;
  std::vector<std::uint32_t> times_;  ///< of the steps, microseconds
  Buffer marks_;
  Buffer starts_;      ///< index of the first event of each block of marks
  Buffer step_times_;  ///< times_
  Buffer total_;
  Buffer events_;
};

}  // namespace eventcamera::gl
