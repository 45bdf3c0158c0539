// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/image.hpp"
#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/random.hpp"

namespace eventcamera {

/// What the pixels remember, an image for each thing.
struct PixelArray {
  PixelArray(int width, int height);

  /// Makes each pixel's thresholds and leak what the settings say, a row at a time.
  void draw_traits(int y, const DvsSettings& settings, const Random& random);

  /// Sets a row of references to a signal that has long been there, and draws the first noise.
  void settle(int y, const DvsSettings& settings, const Random& random);

  std::uint64_t number_of(int x, int y) const {
    return static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(width) +
           static_cast<std::uint64_t>(x);
  }

  int width;
  Image<float> target;     ///< what the response makes of the light now
  Image<float> signal;     ///< what the photoreceptor has made of it so far
  Image<float> reference;  ///< what the signal is compared with
  Image<float> positive;   ///< thresholds; infinite where the pixel is dead
  Image<float> negative;
  Image<float> leak;           ///< the reference falls that much a microsecond
  Image<float> rest;           ///< microseconds until the pixel can fire again, or 0
  Image<std::uint32_t> quiet;  ///< the shot noise to be expected before it fires, 1/noise_unit
};

}  // namespace eventcamera
