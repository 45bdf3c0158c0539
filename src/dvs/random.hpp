// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "src/dvs/elementary.hpp"

namespace eventcamera {

/// Stateless random numbers: each is a hash of seed, pixel, purpose and counter, so it does not
/// depend on the order in which pixels are processed. The hash applies the finalizer of SplitMix64
/// once for each of the four.
class Random {
 public:
  /// Use of a number; numbers for different purposes are independent.
  enum class Purpose : std::uint64_t {
    positive_threshold = 1,
    negative_threshold,
    leak,
    leak_phase,
    defect,
    heat,
    first_noise,
    event,  ///< everything that happens to a pixel over time
  };

  explicit Random(std::uint64_t seed) : key_(mixed(seed + 0x9e3779b97f4a7c15)) {}

  /// Hash of the seed.
  std::uint64_t key() const { return key_; }

  std::uint64_t bits(std::uint64_t pixel, Purpose purpose, std::uint64_t counter = 0) const {
    return mixed(mixed(mixed(key_ + pixel) + static_cast<std::uint64_t>(purpose)) + counter);
  }

  bool coin(std::uint64_t pixel, Purpose purpose, std::uint64_t counter) const {
    return (bits(pixel, purpose, counter) >> 63) != 0;
  }

  /// Uniform in (0, 1).
  double uniform(std::uint64_t pixel, Purpose purpose, std::uint64_t counter = 0) const {
    return to_uniform(bits(pixel, purpose, counter));
  }

  /// Exponentially distributed, with mean 1.
  double exponential(std::uint64_t pixel, Purpose purpose, std::uint64_t counter = 0) const {
    return -logarithm(uniform(pixel, purpose, counter));
  }

  /// Two independent numbers with mean 0 and standard deviation 1 (Box and Muller).
  std::pair<double, double> normals(std::uint64_t pixel, Purpose purpose,
                                    std::uint64_t counter = 0) const {
    const std::uint64_t first = bits(pixel, purpose, counter);
    const double radius = std::sqrt(-2 * std::min(0.0, logarithm(to_uniform(first))));
    // An angle within an eighth of a turn, mirrored at random.
    const std::uint64_t second = mixed(first + 1);
    const double angle = std::numbers::pi / 4 * to_uniform(second << 3);
    const auto [cosine, sine] = cosine_and_sine(angle);
    const bool is_swapped = (second >> 61 & 1) != 0;
    return {mirrored(radius * (is_swapped ? sine : cosine), second),
            mirrored(radius * (is_swapped ? cosine : sine), second << 1)};
  }

 private:
  static double to_uniform(std::uint64_t bits) {
    return std::bit_cast<double>(bits >> 12 | std::uint64_t{1023} << 52) - (1 - 0x1p-53);
  }

  /// Flips the sign of the value if the highest bit is set.
  static double mirrored(double value, std::uint64_t bits) {
    return std::bit_cast<double>(std::bit_cast<std::uint64_t>(value) ^ (bits >> 63 << 63));
  }

  static std::uint64_t mixed(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  }

  std::uint64_t key_;
};

}  // namespace eventcamera
