// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/light_response.hpp"

#include <numbers>

namespace eventcamera {
namespace {

constexpr double white_in_8_bits = 255;

/// v2e's boundary between linear and logarithmic, 8-bit grey levels.
constexpr double linear_up_to = 20;

constexpr double microseconds_a_second = 1e6;

/// Slower than this is not told apart: a pixel that takes minutes.
constexpr double lowest_cutoff_hz = 1e-3;

/// The least share of the shot noise, at white (v2e).
constexpr double noise_at_white = 0.25;

}  // namespace

double light_of(double luma, bool linear_light) {
  if (!linear_light) return luma;
  return luma <= 0.04045 ? luma / 12.92 : std::pow((luma + 0.055) / 1.055, 2.4);
}

double response_of(double light, Response response, double log_eps) {
  if (response == Response::log) return std::log(log_eps + light);
  if (response == Response::linear) return std::log(white_in_8_bits) * light;
  const double x = white_in_8_bits * light;
  return x <= linear_up_to ? x * std::log(linear_up_to) / linear_up_to : std::log(x);
}

LightResponse::LightResponse(const DvsSettings& settings, int bits)
    : values_(std::size_t{1} << bits) {
  for (int luma = 0; luma <= white(); ++luma) {
    const double light = light_of(luma / static_cast<double>(white()), settings.linear_light);
    values_[static_cast<std::size_t>(luma)] =
        static_cast<float>(response_of(light, settings.response, settings.log_eps));
  }
}

ShadeTables::ShadeTables(const DvsSettings& settings, double microseconds) {
  const double fastest =
      2 * std::numbers::pi * std::max(settings.cutoff_hz, lowest_cutoff_hz) / microseconds_a_second;
  const double noisiest = settings.shot_noise_rate_hz / microseconds_a_second;
  for (std::size_t i = 0; i < shades; ++i) {
    const double light = light_of(static_cast<double>(i) / white_in_8_bits, settings.linear_light);
    const double brightness = brightness_of(light, settings.dark_light);
    bandwidth[i] = fastest * brightness;
    const double k = bandwidth[i] * microseconds;
    decays[i] = static_cast<float>(k);
    kept[i] = static_cast<float>(std::exp(-k));
    mean_kept[i] = static_cast<float>(k > 0 ? -std::expm1(-k) / k : 1);
    expected_noise[i] =
        noisiest * (1 - (1 - noise_at_white) * brightness) * microseconds * noise_unit;
    noise[i] = static_cast<std::uint32_t>(std::min(expected_noise[i], 4294967295.0));
  }
}

}  // namespace eventcamera
