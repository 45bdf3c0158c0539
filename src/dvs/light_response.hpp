// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
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

}  // namespace eventcamera
