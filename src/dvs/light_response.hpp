// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "src/dvs/dvs_settings.hpp"

namespace eventcamera {

/// Light of a luma value, both relative to white: the same value or, if `linear_light`, with the
/// sRGB transfer function (IEC 61966-2-1) inverted.
inline double light_of(double luma, bool linear_light) {
  if (!linear_light) return luma;
  return luma <= 0.04045 ? luma / 12.92 : std::pow((luma + 0.055) / 1.055, 2.4);
}

/// Inverse of light_of().
inline double luma_of(double light, bool linear_light) {
  if (!linear_light) return light;
  return light <= 0.04045 / 12.92 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
}

/// Factor of the light of bright luma, which is `overexposed_light` at white and falls to 1 over 20
/// of 255 grey levels below.
inline double overexposure_of(double luma, bool is_narrow, double overexposed_light) {
  constexpr double width = 20.0 / 255;
  const double white = is_narrow ? 235.0 / 255 : 1;
  return 1 + (overexposed_light - 1) * std::clamp((luma - white) / width + 1, 0.0, 1.0);
}

/// Response of the photoreceptor to light, white is 1.
inline double response_of(double light, Response response, double log_eps) {
  constexpr double linear_up_to = 20;  // 8-bit grey levels, as in v2e
  if (response == Response::log) return std::log(log_eps + light);
  if (response == Response::linear) return std::log(255.0) * light;
  const double x = 255 * light;
  return x <= linear_up_to ? x * std::log(linear_up_to) / linear_up_to : std::log(x);
}

/// Responses to all luma values of a bit depth, 8 to 16, in a frame with `gain` times the exposure
/// of the first one.
inline std::vector<float> responses(const DvsSettings& settings, int bits, bool is_narrow,
                                    double gain) {
  std::vector<float> values(std::size_t{1} << bits);
  const auto max_luma = static_cast<double>(values.size() - 1);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double luma = static_cast<double>(i) / max_luma;
    const double light = light_of(luma, settings.linear_light) *
                         overexposure_of(luma, is_narrow, settings.overexposed_light) / gain;
    values[i] = static_cast<float>(response_of(light, settings.response, settings.log_eps));
  }
  return values;
}

/// Shot noise is counted in fixed point, in units of 1/noise_unit events.
inline constexpr double noise_unit = 1 << 27;

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
