// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "src/dvs/random.hpp"

namespace eventcamera {

inline constexpr double never = std::numeric_limits<double>::infinity();

/// Maximum number of random numbers that a pixel draws in a sub-interval.
inline constexpr std::uint64_t draws_per_sub_interval = 1 << 16;

/// Shot noise is counted in fixed point, in units of 1/noise_unit events.
inline constexpr double noise_unit = 1 << 27;

/// Draws the noise budget of a pixel: the expected shot noise until its next noise event,
/// 1/noise_unit. Shot noise is a Poisson process whose rate depends on the light: its next event
/// fires when the integral of the rate has used up the budget, which is exponentially distributed
/// with mean 1.
inline std::uint32_t draw_noise_budget(const Random& random, std::uint64_t pixel,
                                       Random::Purpose purpose, std::uint64_t counter) {
  const double drawn = random.exponential(pixel, purpose, counter) * noise_unit;
  return static_cast<std::uint32_t>(std::clamp(drawn, 1.0, 4294967294.0));
}

/// Shot noise of a pixel in a sub-interval, in units of 1/noise_unit events.
struct ShotNoise {
  double expected;    ///< in the whole sub-interval
  double budget;      ///< expected noise from the last noise event to the next
  double passed = 0;  ///< expected noise up to the last noise event

  /// Time of the next noise event in a sub-interval of this duration; `never` if after its end.
  double next(double duration) const {
    const double then = passed + budget;
    if (expected < 1 || then > expected) return never;
    return duration * (then / expected);
  }

  /// Advances past the next noise event, and draws the following one.
  void draw(const Random& random, std::uint64_t pixel, std::uint64_t counter) {
    passed += budget;
    budget = draw_noise_budget(random, pixel, Random::Purpose::event, counter);
  }

  /// Drops the noise events until the end of the sub-interval, and draws the next one. Noise has no
  /// memory, so the new budget starts there.
  void skip(const Random& random, std::uint64_t pixel, std::uint64_t counter) {
    if (expected < 1 || passed + budget > expected) return;
    draw(random, pixel, counter);
    passed = expected;
  }

  /// Noise budget at the end of the sub-interval.
  std::uint32_t left() const {
    return static_cast<std::uint32_t>(std::clamp(budget - (expected - passed), 1.0, 4294967294.0));
  }
};

}  // namespace eventcamera
