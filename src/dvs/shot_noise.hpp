// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>

#include "src/dvs/light_response.hpp"
#include "src/dvs/random.hpp"

namespace eventcamera {

/// Shot noise is a Poisson process whose rate goes with the light: its next event comes when the
/// rate, summed up over time, has reached a number from the exponential distribution of mean 1.
/// A pixel keeps what is left of that number, in 1/noise_unit.
inline std::uint32_t quiet_before_noise(const Random& random, std::uint64_t pixel,
                                        Random::Purpose purpose, std::uint64_t counter) {
  const double drawn = random.exponential(pixel, purpose, counter) * noise_unit;
  return static_cast<std::uint32_t>(std::clamp(drawn, 1.0, 4294967294.0));
}

}  // namespace eventcamera
