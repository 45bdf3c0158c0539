// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/light_response.hpp"
#include "src/dvs/shot_noise.hpp"

namespace eventcamera {

/// Number of luma levels for bandwidth and noise, which depend on the light (v2e) but need not be
/// exact.
inline constexpr int shades = 256;

/// Bandwidth and noise of pixels of each shade in a sub-interval.
struct ShadeTables {
  std::array<float, shades> exponent;           ///< k = bandwidth times duration
  std::array<float, shades> decay_factor;       ///< exp(-k), decay of the lag behind the light
  std::array<float, shades> mean_decay_factor;  ///< (1 - exp(-k)) / k, its mean over the duration
  std::array<std::uint32_t, shades> noise;      ///< expected shot noise, 1/noise_unit

  std::array<double, shades> bandwidth;  ///< 1/us
  std::array<double, shades> expected_noise;

  double duration;  ///< microseconds

  /// Of a frame with `gain` times the exposure of the first one.
  ShadeTables(const DvsSettings& settings, double microseconds, double gain)
      : duration(microseconds) {
    constexpr double min_cutoff_hz = 1e-3;  // minutes; a lower one makes no difference
    constexpr double noise_at_white = 0.25;
    const double max_bandwidth =
        2 * std::numbers::pi * std::max(settings.cutoff_frequency, min_cutoff_hz) / 1e6;
    const double max_noise_rate = settings.shot_noise_rate / 1e6;
    for (std::size_t i = 0; i < shades; ++i) {
      const double light = light_of(static_cast<double>(i) / 255, settings.linear_light) / gain;
      // In (0, 1]; scales the bandwidth, and reduces the noise, relative to a dark pixel.
      const double brightness =
          std::min(1.0, (light + settings.dark_light) / (1 + settings.dark_light));
      bandwidth[i] = max_bandwidth * brightness;
      const double k = bandwidth[i] * duration;
      exponent[i] = static_cast<float>(k);
      decay_factor[i] = static_cast<float>(std::exp(-k));
      mean_decay_factor[i] = static_cast<float>(k > 0 ? -std::expm1(-k) / k : 1);
      expected_noise[i] =
          max_noise_rate * (1 - (1 - noise_at_white) * brightness) * duration * noise_unit;
      noise[i] = static_cast<std::uint32_t>(std::min(expected_noise[i], 4294967295.0));
    }
  }
};

}  // namespace eventcamera
