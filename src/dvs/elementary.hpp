// SPDX-License-Identifier: LGPL-2.1-or-later
// Elementary functions with the same results on every machine, branch-free and inline. Vector
// versions are in solver-inl.hpp.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <utility>

namespace eventcamera {

/// exp(-x) for x >= 0 with a relative error of 1e-12.
inline double decay(double x) {
  constexpr double log2_e = 1.4426950408889634;
  constexpr double ln_2 = 0.6931471805599453;
  constexpr double to_integers = 0x1.8p52;  // doubles of this magnitude are integers
  x = std::min(x, 700.0);                   // beyond, the result is close to 0
  const double shifted = x * log2_e + to_integers;
  const double r = (shifted - to_integers) * ln_2 - x;  // |r| <= ln_2 / 2
  const double r2 = r * r;
  const double r4 = r2 * r2;
  const double low = (1 + r) + r2 * (1.0 / 2 + r * (1.0 / 6));
  const double middle = (1.0 / 24 + r * (1.0 / 120)) + r2 * (1.0 / 720 + r * (1.0 / 5040));
  const double high = (1.0 / 40320 + r * (1.0 / 362880)) + r2 * (1.0 / 3628800);
  const double mantissa = low + r4 * (middle + r4 * high);
  // The lowest bits of `shifted` are the power of 1/2.
  const auto exponent = (std::uint64_t{1023} << 52) - (std::bit_cast<std::uint64_t>(shifted) << 52);
  return mantissa * std::bit_cast<double>(exponent);
}

/// ln(x) for normal x > 0 with an error of 1e-13, and relative to the result of 1e-11.
inline double logarithm(double x) {
  constexpr double ln_2 = 0.6931471805599453;
  constexpr double root = 1.4142135623730951;
  const auto bits = std::bit_cast<std::uint64_t>(x);
  const double exponent = static_cast<double>(static_cast<int>(bits >> 52)) - 1023;
  const auto mantissa =
      std::bit_cast<double>((bits & ((std::uint64_t{1} << 52) - 1)) | std::uint64_t{1023} << 52);
  // ln((1 + s) / (1 - s)) = 2 (s + s^3 / 3 + s^5 / 5 ...), of the mantissa over sqrt(2).
  const double s = (mantissa - root) / (mantissa + root);
  const double s2 = s * s;
  double sum = 1.0 / 15;
  for (int i = 13; i > 0; i -= 2) sum = sum * s2 + 1.0 / i;
  return (exponent + 0.5) * ln_2 + (s + s) * sum;
}

/// Cosine and sine of an angle from 0 to pi/4, with an error of 3e-8.
inline std::pair<double, double> cosine_and_sine(double x) {
  const double x2 = x * x;
  const double cosine =
      1 + x2 * (-1.0 / 2 + x2 * (1.0 / 24 + x2 * (-1.0 / 720 + x2 * (1.0 / 40320))));
  const double sine =
      x + x * x2 * (-1.0 / 6 + x2 * (1.0 / 120 + x2 * (-1.0 / 5040 + x2 * (1.0 / 362880))));
  return {cosine, sine};
}

}  // namespace eventcamera
