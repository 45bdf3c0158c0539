// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "src/core/event_buckets.hpp"
#include "src/core/label.hpp"

namespace eventcamera {

/// Arbiter of the readout: reads one row at a time, first come, first served, at a limited event
/// rate. Events get the time of the readout of their row. A waiting pixel drops further events, so
/// at most one event per pixel waits, and events beyond the readout rate are lost.
class Readout {
 public:
  Readout(int width, int height);

  void drop_causes() {
    for (auto& waiting : waiting_) waiting &= ~cause_bits;
  }

  void reset();

  /// Admits the sorted events of an interval of `duration` microseconds, with_cause(), and fills
  /// `out` with those read out within it; the others wait for the next interval.
  void read(std::span<const Event> in, double duration, double events_per_second, StepBuckets& out);

 private:
  /// Waiting event of a pixel, without a time; 0 if none.
  using Waiting = std::uint8_t;
  static constexpr Waiting waits_bit = 1;
  static constexpr Waiting on_bit = 2;
  static constexpr int cause_shift = 2;
  static constexpr Waiting cause_bits = 7 << cause_shift;

  /// Columns [first, last) of a row hold its `count` waiting events.
  struct Row {
    int first = 0;
    int last = 0;
    int count = 0;
  };

  void admit(const Event& event);
  /// Appends the waiting events of a row, with the time `t`.
  void append(int y, std::uint32_t t, std::vector<Event>& out) const;
  void serve(int y, std::uint32_t t, std::vector<Event>& out);

  std::size_t place_of(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }

  int width_;
  std::vector<Waiting> waiting_;  ///< by pixel
  std::vector<Row> rows_;
  std::vector<int> row_queue_;  ///< ring of the rows with waiting events
  std::size_t queue_first_ = 0;
  std::size_t queue_count_ = 0;
  double unfinished_ = 0;  ///< events of the row being read out, which is not in rows_
};

}  // namespace eventcamera
