// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "src/core/event_buckets.hpp"
#include "src/core/thread_pool.hpp"
#include "src/core/time_slices.hpp"

namespace eventcamera {

/// Rolling shutter of a frame camera, which reads the rows of a frame one after another: delays the
/// events of a row by the time from the first row read. Events past the end of an interval are
/// deferred to the next one.
///
/// All times are whole microseconds, rounded down, so events of a pixel stay distinct.
class RollingShutter {
 public:
  explicit RollingShutter(int height) : height_(height) {}

  /// Returns the delayed events of an interval, with deferred ones, valid until the next call.
  /// `readout` is the time from the first row read to the last: from top to bottom or, if negative,
  /// from bottom to top.
  const EventBuckets& delay(const EventBuckets& events, Nanoseconds duration, Nanoseconds readout,
                            ThreadPool& threads);

  /// Like delay(), without new events.
  const EventBuckets& delay_none(Nanoseconds duration, ThreadPool& threads);

  /// Time from the end of the last interval to the last deferred event, if any.
  std::optional<Nanoseconds> latest() const;

  /// Drops the causes of the deferred events.
  void drop_causes();

  /// Drops the deferred events.
  void restart() { bands_.clear(); }

 private:
  /// On its own cache line, because threads fill neighbouring bands concurrently.
  struct alignas(64) Band {
    std::vector<Event> due;       ///< in the interval
    std::vector<Event> deferred;  ///< their times are relative to the next interval
  };

  void set_readout(Nanoseconds readout);

  int height_;
  Nanoseconds readout_ = 0;
  std::vector<std::uint32_t> delays_;  ///< by row
  std::vector<Band> bands_;
  TimeSlices delayed_;
};

}  // namespace eventcamera
