// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "src/dvs/dvs_settings.hpp"

namespace eventcamera {

/// The light of a luma value, which is a share of white: itself, or what the transfer function of
/// sRGB (IEC 61966-2-1) made it from.
double light_of(double luma, bool linear_light);

/// What the photoreceptor makes of light, 0 ... 1.
double response_of(double light, Response response, double log_eps);

/// How fast a photoreceptor is, and how quiet, beside one that sees white: in (0, 1] (v2e).
inline double brightness_of(double light, double dark_light) {
  return (light + dark_light) / (1 + dark_light);
}

/// The response to each luma value of a bit depth.
class LightResponse {
 public:
  /// For luma of 8 to 16 bits.
  LightResponse(const DvsSettings& settings, int bits);

  const float* values() const { return values_.data(); }
  int white() const { return static_cast<int>(values_.size()) - 1; }

 private:
  std::vector<float> values_;
};

/// Luma is told apart in this many shades where what hangs on it need not be exact: the speed of a
/// photoreceptor and its noise.
inline constexpr int shades = 256;

/// What happens within a while to a pixel of each shade.
struct ShadeTables {
  std::array<float, shades> decays;         ///< k: bandwidth times the while
  std::array<float, shades> kept;           ///< exp(-k), the share of a lag that is left
  std::array<float, shades> mean_kept;      ///< (1 - exp(-k)) / k, its mean over the while
  std::array<std::uint32_t, shades> noise;  ///< expected shot noise, in 1/noise_unit

  std::array<double, shades> bandwidth;  ///< 1/us; k exactly
  std::array<double, shades> expected_noise;

  ShadeTables(const DvsSettings& settings, double microseconds);
};

/// Of the fixed-point numbers that shot noise is counted in.
inline constexpr double noise_unit = 1 << 27;

}  // namespace eventcamera
