// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <optional>

#include "src/core/event.hpp"

namespace eventcamera {

/// Maps a camera's clock to the clock of the pipeline. Transfers may be late but never early, so
/// the least delayed transfer of the last two seconds gives the offset between the clocks. The
/// offset changes only when it is off by more than max_error, so intervals between events stay
/// exact. Clocks within 300 ppm are mapped to within 2 ms of the least delayed transfer.
class ArrivalClock {
 public:
  static constexpr Nanoseconds max_error = 1'000'000;

  /// Records that data up to the time `sent` arrived at `arrival`. After a gap, the camera's clock
  /// may have been reset. Returns true if the offset changed.
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

  /// Arrival time minus camera time; none before the first arrival.
  std::optional<Nanoseconds> offset() const { return offset_; }

  /// Parts per million by which the camera's clock is slow, since its first transfer.
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
  Nanoseconds epoch_ = 0;                ///< start of this epoch
  Nanoseconds min_offset_ = never;       ///< of this epoch
  Nanoseconds last_min_offset_ = never;  ///< of the previous epoch
  Epoch first_;
  double drift_ = 0;
};

}  // namespace eventcamera
