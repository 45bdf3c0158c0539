// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/pixel_array.hpp"

#include "src/dvs/mismatch.hpp"
#include "src/dvs/shot_noise.hpp"

namespace eventcamera {

PixelArray::PixelArray(int w, int height)
    : width(w),
      target(w, height),
      signal(w, height),
      reference(w, height),
      positive(w, height),
      negative(w, height),
      leak(w, height),
      rest(w, height),
      quiet(w, height) {}

void PixelArray::draw_traits(int y, const DvsSettings& settings, const Random& random) {
  const Mismatch mismatch(settings, random);
  for (int x = 0; x < width; ++x) {
    const auto traits = mismatch.of(number_of(x, y));
    positive.at(x, y) = static_cast<float>(traits.positive_threshold);
    negative.at(x, y) = static_cast<float>(traits.negative_threshold);
    leak.at(x, y) = static_cast<float>(traits.leak);
  }
}

void PixelArray::settle(int y, const DvsSettings& settings, const Random& random) {
  const Mismatch mismatch(settings, random);
  const double noise_rate = settings.shot_noise_rate_hz / 1e6;
  for (int x = 0; x < width; ++x) {
    const auto pixel = number_of(x, y);
    const PixelTraits traits{positive.at(x, y), negative.at(x, y), leak.at(x, y)};
    signal.at(x, y) = target.at(x, y);
    reference.at(x, y) =
        static_cast<float>(target.at(x, y) - mismatch.leaked(pixel, traits, noise_rate));
    rest.at(x, y) = 0;
    quiet.at(x, y) = quiet_before_noise(random, pixel, Random::Purpose::first_noise, 0);
  }
}

}  // namespace eventcamera
