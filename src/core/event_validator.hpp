// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <span>

#include "src/core/event.hpp"

namespace eventcamera {

/// Ensures that events lie inside the sensor and are sorted by time.
class EventValidator {
 public:
  EventValidator(int width, int height) : width_(width), height_(height) {}

  /// Calls take() for each event; event times are relative to `start`. A late event gets the time
  /// of the previous one, or the first time after the last pass(); events outside the sensor are
  /// dropped. Returns the number of dropped events.
  template <class Take>
  std::size_t take(std::span<const Event> events, Microseconds start, const Take& take) {
    std::size_t dropped = 0;
    for (const auto& event : events) {
      if (event.x >= width_ || event.y() >= height_) {
        ++dropped;
        continue;
      }
      earliest_ = std::max(earliest_, time_of(event, start));
      take(AbsoluteEvent{earliest_, event.x, event.y_p});
    }
    return dropped;
  }

  /// Declares that a picture was drawn up to `end`. Returns `end`, or the time of the last event if
  /// that is later.
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
