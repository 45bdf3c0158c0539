// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/core/event.hpp"
#include "src/core/image.hpp"

namespace eventcamera {

/// How long ago the last event of each pixel was, and its polarity.
class TimeSurface {
 public:
  /// Events older than `max_age`, which is above 0, are forgotten.
  TimeSurface(int width, int height, Microseconds max_age)
      : max_age_(max_age), last_(width, height) {}

  /// Takes an event inside the picture, not before the last one.
  void add(const AbsoluteEvent& event) {
    last_.at(event.x, event.y()) = {event.t, event.polarity() == Polarity::on ? 1.0F : -1.0F};
  }

  /// How recent a row's events are at a time that is not before any of them: from 1, just now, down
  /// to 0; negative where the last event is OFF.
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
