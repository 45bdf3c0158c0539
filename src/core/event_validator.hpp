// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <span>

#include "src/core/label.hpp"

namespace eventcamera {

/// Numbers of invalid events.
struct InvalidEvents {
  std::size_t outside = 0;   ///< x or y past the sensor
  std::size_t unsorted = 0;  ///< earlier than the previous event, or past the end of the buffer

  friend bool operator==(const InvalidEvents&, const InvalidEvents&) = default;
};

/// Ensures that events lie inside the sensor and are sorted by time.
class EventValidator {
 public:
  EventValidator(int width, int height) : width_(width), height_(height) {}

  /// Calls `use` for each valid event; times are relative to `start`. Late events, before the
  /// previous one or before passed(), get that time; events outside the sensor or after `max_t` are
  /// dropped. `labels` is empty or has one label per event. Returns the numbers of dropped events.
  template <class Use>
  InvalidEvents for_each_valid(std::span<const Event> events, Microseconds start,
                               Microseconds max_t, const Use& use,
                               std::span<const Label> labels = {}) {
    InvalidEvents dropped;
    for (std::size_t i = 0; i < events.size(); ++i) {
      const Event& event = events[i];
      const bool is_outside = event.x >= width_ || event.y() >= height_;
      if (is_outside || event.t > max_t) {
        ++(is_outside ? dropped.outside : dropped.unsorted);
        continue;
      }
      earliest_ = std::max(earliest_, start + event.t);
      AbsoluteEvent valid{earliest_, event.x, event.y_p};
      if (!labels.empty()) set_label(valid, labels[i]);
      use(valid);
    }
    return dropped;
  }

  void restart() { *this = {width_, height_}; }

  /// Treats events before `time` as late from now on.
  void pass(Microseconds time) { earliest_ = std::max(earliest_, time); }

  /// Time before which events are late.
  Microseconds passed() const { return earliest_; }

 private:
  int width_;
  int height_;
  Microseconds earliest_ = std::numeric_limits<Microseconds>::min() / 4;
};

}  // namespace eventcamera
