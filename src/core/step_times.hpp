// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>

namespace eventcamera {

using Nanoseconds = std::int64_t;

/// The longest interval whose microseconds fit into an event's 32 bits (71 minutes).
inline constexpr Nanoseconds max_interval = Nanoseconds{0xffffffff} * 1000;

/// The moments of the steps into which an interval (t0, t1] is cut: step j of `count` happens at
/// t0 + (t1 - t0) * j / count, and the last one at t1.
///
/// Steps shorter than a microsecond could not be told apart in an event stream, so no more steps
/// are made than the interval has whole microseconds.
class StepTimes {
 public:
  /// `duration` in (0, max_interval]; `wanted` steps, at least 1.
  StepTimes(Nanoseconds duration, int wanted)
      : duration_(duration),
        count_(static_cast<int>(
            std::clamp<Nanoseconds>(duration / 1000, 1, static_cast<Nanoseconds>(wanted)))) {}

  Nanoseconds duration() const { return duration_; }
  int count() const { return count_; }
  /// Microseconds from t0 to step j (1 ... count), rounded down.
  std::uint32_t microseconds(int j) const {
    return static_cast<std::uint32_t>(duration_ * j / count_ / 1000);
  }

 private:
  Nanoseconds duration_;
  int count_;
};

}  // namespace eventcamera
