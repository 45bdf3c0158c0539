// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <optional>

#include "src/core/event.hpp"

namespace eventcamera {

/// Maps the clock of a camera to the one by which its transfers arrive. Transfers can be late but
/// never early, so the least delayed one of the last two seconds gives the offset between the
/// clocks. The offset stays until it is off by more than max_error, so that events keep their
/// distances: clocks that drift apart by up to 300 ppm are mapped to within 2 ms of that transfer.
class ArrivalClock {
 public:
  static constexpr Nanoseconds max_error = 1'000'000;

  /// Notes that data up to the time `sent` arrived at `arrival`. After a gap, the camera's clock
  /// may be another one. True if the offset changed.
  bool arrive(Microseconds sent, Nanoseconds arrival, bool after_gap) {
    const auto offset = arrival - sent * 1000;
    const bool is_early = offset_ && offset < *offset_ - max_error;
    const bool is_another = offset_ && after_gap && std::abs(offset - *offset_) > max_jitter;
    if (!offset_ || is_early || is_another) {
      if (!offset_ || is_another) first_ = {};
      begin_epoch(arrival);
      last_min_offset_ = never;
      min_offset_ = offset;
      offset_ = offset;
      return true;
    }
    min_offset_ = std::min(min_offset_, offset);
    if (arrival - epoch_ < epoch_length) return false;
    const auto min_offset = std::min(min_offset_, last_min_offset_);
    note_drift(arrival);
    last_min_offset_ = min_offset_;
    begin_epoch(arrival);
    if (min_offset - *offset_ <= max_error) return false;
    offset_ = min_offset;
    return true;
  }

  /// Time of arrival minus that of the camera; nothing before the first arrival.
  std::optional<Nanoseconds> offset() const { return offset_; }

  /// Parts per million that the camera's clock is slow, measured since the clock began.
  double drift() const { return drift_; }

 private:
  static constexpr Nanoseconds epoch_length = 1'000'000'000;
  static constexpr Nanoseconds max_jitter = 100'000'000;
  static constexpr Nanoseconds never = std::numeric_limits<Nanoseconds>::max();

  /// Minimum offset of an epoch, and its end.
  struct Epoch {
    Nanoseconds end = 0;
    Nanoseconds min_offset = never;
  };

  void begin_epoch(Nanoseconds arrival) {
    epoch_ = arrival;
    min_offset_ = never;
  }

  void note_drift(Nanoseconds arrival) {
    if (first_.min_offset == never) {
      first_ = {arrival, min_offset_};
      return;
    }
    drift_ = 1e6 * static_cast<double>(min_offset_ - first_.min_offset) /
             static_cast<double>(arrival - first_.end);
  }

  std::optional<Nanoseconds> offset_;
  Nanoseconds epoch_ = 0;                ///< its start
  Nanoseconds min_offset_ = never;       ///< of this epoch
  Nanoseconds last_min_offset_ = never;  ///< and of the one before
  Epoch first_;
  double drift_ = 0;
};

}  // namespace eventcamera
