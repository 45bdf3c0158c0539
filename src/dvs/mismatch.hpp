// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/random.hpp"

namespace eventcamera {

/// What one pixel is like.
struct PixelTraits {
  double positive_threshold;  ///< infinite where the pixel is dead
  double negative_threshold;
  double leak;  ///< its reference falls that much a microsecond
};

/// The pixels' differences, fixed by the seed.
class Mismatch {
 public:
  Mismatch(const DvsSettings& settings, const Random& random)
      : settings_(settings), random_(random) {}

  PixelTraits of(std::uint64_t pixel) const;

  /// The thresholds after another event, `counter`, where they change from event to event.
  double next_positive_threshold(std::uint64_t pixel, std::uint64_t counter) const;
  double next_negative_threshold(std::uint64_t pixel, std::uint64_t counter) const;

  /// How far the reference has fallen when the first frame comes, if noise of this rate (1/us)
  /// sets it back: the camera has been on for long.
  double leaked(std::uint64_t pixel, const PixelTraits& traits, double noise_rate) const;

 private:
  double fixed_threshold(std::uint64_t pixel, double mean, Random::Purpose purpose) const;

  const DvsSettings& settings_;
  const Random& random_;
};

}  // namespace eventcamera
