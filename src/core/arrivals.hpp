// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <span>

#include "src/core/absolute_event.hpp"

namespace eventcamera {

/// The time of an event in microseconds. Rounded down to the start of its interval (start, end] it
/// would belong to the interval before.
constexpr Microseconds time_of(const Event& event, Microseconds start) {
  return start + (event.t == 0 ? 1 : event.t);
}

/// Those of sorted events, which count their times from `start`, that are not later than `end`.
inline std::span<const Event> events_until(std::span<const Event> events, Microseconds start,
                                           Microseconds end) {
  const auto first_after =
      std::ranges::find_if(events, [&](const Event& event) { return time_of(event, start) > end; });
  return events.first(static_cast<std::size_t>(first_after - events.begin()));
}

/// Ensures what others rely on: events lie inside the picture and are sorted by time.
class Arrivals {
 public:
  Arrivals(int width, int height) : width_(width), height_(height) {}

  /// Passes on events that count their times from `start`. A late event is moved to the time of the
  /// last one, or to after pass(); one outside the picture is skipped. Returns how many were
  /// skipped.
  template <class Take>
  std::size_t take(std::span<const Event> events, Microseconds start, const Take& take) {
    std::size_t skipped = 0;
    for (const auto& event : events) {
      if (event.x >= width_ || event.y() >= height_) {
        ++skipped;
        continue;
      }
      earliest_ = std::max(earliest_, time_of(event, start));
      take(AbsoluteEvent{earliest_, event.x, event.y_p});
    }
    return skipped;
  }

  /// A picture was drawn up to this time. Returns it, or that of the last event if that is later.
  Microseconds pass(Microseconds end) {
    const auto latest = std::max(earliest_, end);
    earliest_ = std::max(earliest_, end + 1);
    return latest;
  }

 private:
  int width_;
  int height_;
  Microseconds earliest_ = std::numeric_limits<Microseconds>::min() / 4;
};

}  // namespace eventcamera
