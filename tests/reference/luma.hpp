// SPDX-License-Identifier: LGPL-2.1-or-later
// Luma of red, green and blue, as plainly as it can be written.
#pragma once

#include <cstdint>

#include "src/core/rgb_luma.hpp"

namespace eventcamera::reference {

/// The nearest integer to the weighted mean, upwards half-way.
inline int luma(const LumaWeights& weights, std::int64_t red, std::int64_t green,
                std::int64_t blue) {
  const std::int64_t sum = weights.red * red + weights.green * green + weights.blue * blue;
  return static_cast<int>((sum + LumaWeights::one / 2) / LumaWeights::one);
}

/// The nearest integer to `value` behind `alpha` of `white`, on `black`.
inline int on_black(std::int64_t value, std::int64_t alpha, std::int64_t white,
                    std::int64_t black) {
  const std::int64_t sum = value * alpha + black * (white - alpha);
  return static_cast<int>((2 * sum + white) / (2 * white));
}

/// A colour of 5 or 6 bits in 8: black stays black, and white white.
inline int in_8_bits(int value, int bits) {
  return bits == 5 ? value * 8 + value / 4 : value * 4 + value / 16;
}

}  // namespace eventcamera::reference
