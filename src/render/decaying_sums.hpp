// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>

#include "src/core/image.hpp"
#include "src/render/exponential.hpp"

namespace eventcamera {

/// A sum of ON minus OFF for each pixel, which fades exponentially.
class DecayingSums {
 public:
  /// A sum is held between -`most` and `most`.
  DecayingSums(int width, int height, Microseconds time_constant, float most)
      : exponential_(time_constant), most_(most), sums_(width, height) {}

  /// An event inside the picture, not before the last one.
  void add(const AbsoluteEvent& event) {
    auto& sum = sums_.at(event.x, event.y());
    const float step = event.polarity() == Polarity::on ? 1.0F : -1.0F;
    sum.value =
        std::clamp(sum.value * exponential_.after(event.t - sum.time) + step, -most_, most_);
    sum.time = event.t;
  }

  /// A row's sums at a time that is not before any event, as shares of the most.
  template <class Take>
  void read_row(int y, Microseconds time, const Take& take) const {
    const auto* row = sums_.row(y);
    for (int x = 0; x < sums_.width(); ++x)
      take(x,
           row[x].value == 0 ? 0 : row[x].value * exponential_.after(time - row[x].time) / most_);
  }

 private:
  struct Sum {
    float value = 0;
    Microseconds time = 0;  ///< of the last event
  };

  Exponential exponential_;
  float most_;
  Image<Sum> sums_;
};

}  // namespace eventcamera
