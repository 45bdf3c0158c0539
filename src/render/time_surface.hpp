// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/core/event.hpp"
#include "src/core/image.hpp"

namespace eventcamera {

/// Age and polarity of the last event of each pixel.
class TimeSurface {
 public:
  /// Events older than `max_age` > 0 are ignored.
  TimeSurface(int width, int height, Microseconds max_age)
      : max_age_(max_age), last_(width, height) {}

  /// Adds an event, which must lie inside the picture and not be earlier than the last one.
  void add(const AbsoluteEvent& event) {
    last_.at(event.x, event.y()) = {event.t, event.polarity() == Polarity::on ? 1.0F : -1.0F};
  }

  /// Passes a value per pixel of a row to `take`: from 1 for an event at `time` down to 0 at
  /// `max_age`; negative if the last event is OFF. `time` must not be before any event.
  template <class Take>
  void read_row(int y, Microseconds time, const Take& take) const {
    const auto* row = last_.row(y);
    const float scale = 1 / static_cast<float>(max_age_);
    for (int x = 0; x < last_.width(); ++x) {
      const Microseconds left = max_age_ - (time - row[x].time);
      take(x, left > 0 ? row[x].sign * static_cast<float>(left) * scale : 0);
    }
  }

 private:
  struct Last {
    Microseconds time = 0;
    float sign = 0;  ///< 0 = no event
  };

  Microseconds max_age_;
  Image<Last> last_;
};

}  // namespace eventcamera
