// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace eventcamera {

/// Random numbers without a state: each is a hash of what it is for, so it does not hang on the
/// order in which pixels are worked on. The hash is the finalizer of SplitMix64, once for each of
/// seed, pixel, purpose and counter.
class Random {
 public:
  /// What a number is for; numbers for different purposes know nothing of each other.
  enum class Purpose : std::uint64_t {
    positive_threshold = 1,
    negative_threshold,
    leak,
    leak_phase,
    defect,
    heat,
    first_noise,
    course,  ///< what happens to a pixel as time passes
  };

  explicit Random(std::uint64_t seed) : key_(mixed(seed + 0x9e3779b97f4a7c15)) {}

  std::uint64_t bits(std::uint64_t pixel, Purpose purpose, std::uint64_t counter = 0) const {
    return mixed(mixed(mixed(key_ + pixel) + static_cast<std::uint64_t>(purpose)) + counter);
  }

  /// In (0, 1).
  double uniform(std::uint64_t pixel, Purpose purpose, std::uint64_t counter = 0) const {
    return to_uniform(bits(pixel, purpose, counter));
  }

  /// With mean and deviation 1.
  double exponential(std::uint64_t pixel, Purpose purpose, std::uint64_t counter = 0) const {
    return -std::log(uniform(pixel, purpose, counter));
  }

  /// With mean 0 and deviation 1 (Box and Muller).
  double normal(std::uint64_t pixel, Purpose purpose, std::uint64_t counter = 0) const {
    const std::uint64_t first = bits(pixel, purpose, counter);
    return std::sqrt(-2 * std::log(to_uniform(first))) *
           std::cos(2 * std::numbers::pi * to_uniform(mixed(first + 1)));
  }

 private:
  static double to_uniform(std::uint64_t bits) {
    return (static_cast<double>(bits >> 11) + 0.5) * 0x1p-53;
  }

  static std::uint64_t mixed(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  }

  std::uint64_t key_;
};

}  // namespace eventcamera
