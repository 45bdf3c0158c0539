// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "src/core/event.hpp"
#include "src/core/image.hpp"

namespace eventcamera {

/// Table of the exponential decay exp(-age / time constant).
class Exponential {
 public:
  /// `time_constant` must be above 0.
  explicit Exponential(Microseconds time_constant)
      : steps_per_microsecond_(steps_per_constant / static_cast<float>(time_constant)) {
    for (std::size_t i = 0; i < table_.size(); ++i)
      table_[i] = std::exp(-static_cast<float>(i) / steps_per_constant);
  }

  /// Exact at age 0, else accurate to 0.01 %; 0 below 1/3000.
  float after(Microseconds age) const {
    const float steps = static_cast<float>(age) * steps_per_microsecond_;
    if (!(steps < max_steps)) return 0;
    const auto step = static_cast<std::size_t>(steps);
    const float share = steps - static_cast<float>(step);
    return table_[step] + share * (table_[step + 1] - table_[step]);
  }

 private:
  static constexpr float steps_per_constant = 32;
  static constexpr float max_steps = 8 * steps_per_constant;

  float steps_per_microsecond_;
  std::array<float, static_cast<std::size_t>(max_steps) + 1> table_;
};

/// Exponentially decaying sum of ON minus OFF events per pixel.
class DecayingSums {
 public:
  /// Sums are clamped to [-`max`, `max`].
  DecayingSums(int width, int height, Microseconds time_constant, float max)
      : exponential_(time_constant), max_(max), sums_(width, height) {}

  /// Adds an event, which must lie inside the picture and not be earlier than the last one.
  void add(const AbsoluteEvent& event) {
    auto& sum = sums_.at(event.x, event.y());
    const float step = event.polarity() == Polarity::on ? 1.0F : -1.0F;
    sum.value = std::clamp(sum.value * exponential_.after(event.t - sum.time) + step, -max_, max_);
    sum.time = event.t;
  }

  /// Passes the sums of a row to `take`, as fractions of the maximum. `time` must not be before any
  /// event.
  template <class Take>
  void read_row(int y, Microseconds time, const Take& take) const {
    const auto* row = sums_.row(y);
    for (int x = 0; x < sums_.width(); ++x)
      take(x, row[x].value == 0 ? 0 : row[x].value * exponential_.after(time - row[x].time) / max_);
  }

 private:
  struct Sum {
    float value = 0;
    Microseconds time = 0;  ///< time of the last event
  };

  Exponential exponential_;
  float max_;
  Image<Sum> sums_;
};

}  // namespace eventcamera
