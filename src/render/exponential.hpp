// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "src/core/absolute_event.hpp"

namespace eventcamera {

/// What is left of 1 after some time: exp(-age / time constant), from a table.
class Exponential {
 public:
  /// More than 0.
  explicit Exponential(Microseconds time_constant)
      : steps_per_microsecond_(steps_per_constant / static_cast<float>(time_constant)) {
    for (std::size_t i = 0; i < table_.size(); ++i)
      table_[i] = std::exp(-static_cast<float>(i) / steps_per_constant);
  }

  /// Exact where the age is 0, and 0.01 % off elsewhere; 0 where less than 1/3000 is left.
  float after(Microseconds age) const {
    const float steps = static_cast<float>(age) * steps_per_microsecond_;
    if (!(steps < longest)) return 0;
    const auto step = static_cast<std::size_t>(steps);
    const float share = steps - static_cast<float>(step);
    return table_[step] + share * (table_[step + 1] - table_[step]);
  }

 private:
  static constexpr float steps_per_constant = 32;
  static constexpr float longest = 8 * steps_per_constant;

  float steps_per_microsecond_;
  std::array<float, static_cast<std::size_t>(longest) + 1> table_;
};

}  // namespace eventcamera
