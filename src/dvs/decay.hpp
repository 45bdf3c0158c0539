// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

namespace eventcamera {

/// exp(-x) of x >= 0 to 1e-12 of itself: the same on every machine, without a branch, and inline.
inline double decay(double x) {
  constexpr double log2_e = 1.4426950408889634;
  constexpr double ln_2 = 0.6931471805599453;
  constexpr double to_integers = 0x1.8p52;  // doubles as large are integers
  x = std::min(x, 700.0);                   // beyond, there is next to nothing
  const double shifted = x * log2_e + to_integers;
  const double r = (shifted - to_integers) * ln_2 - x;  // at most half of ln_2
  const double r2 = r * r;
  const double r4 = r2 * r2;
  const double low = (1 + r) + r2 * (1.0 / 2 + r * (1.0 / 6));
  const double middle = (1.0 / 24 + r * (1.0 / 120)) + r2 * (1.0 / 720 + r * (1.0 / 5040));
  const double high = (1.0 / 40320 + r * (1.0 / 362880)) + r2 * (1.0 / 3628800);
  const double mantissa = low + r4 * (middle + r4 * high);
  // Halved as often as `shifted` counts in its lowest bits.
  const auto exponent = (std::uint64_t{1023} << 52) - (std::bit_cast<std::uint64_t>(shifted) << 52);
  return mantissa * std::bit_cast<double>(exponent);
}

}  // namespace eventcamera
