// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/mismatch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace eventcamera {
namespace {

using Purpose = Random::Purpose;

constexpr double microseconds_a_second = 1e6;

/// A threshold of 0 would fire for ever.
constexpr double min_threshold = 1e-3;

/// Nor does mismatch take more than this from one.
constexpr double min_share = 0.1;

/// Hot pixels leak so many ON events a second, evenly spread over the decades.
constexpr double coolest_hz = 10;
constexpr double hottest_hz = 1000;

double bounded(double threshold, double mean) {
  return std::max({threshold, min_share * mean, min_threshold});
}

}  // namespace

double Mismatch::fixed_threshold(std::uint64_t pixel, double mean, Purpose purpose) const {
  if (settings_.threshold_sigma <= 0) return std::max(mean, min_threshold);
  return bounded(mean + settings_.threshold_sigma * random_.normal(pixel, purpose), mean);
}

double Mismatch::next_positive_threshold(std::uint64_t pixel, std::uint64_t counter) const {
  const double mean =
      fixed_threshold(pixel, settings_.positive_threshold, Purpose::positive_threshold);
  return bounded(
      mean + settings_.threshold_jitter * random_.normal(pixel, Purpose::course, counter), mean);
}

double Mismatch::next_negative_threshold(std::uint64_t pixel, std::uint64_t counter) const {
  const double mean =
      fixed_threshold(pixel, settings_.negative_threshold, Purpose::negative_threshold);
  return bounded(
      mean + settings_.threshold_jitter * random_.normal(pixel, Purpose::course, counter), mean);
}

PixelTraits Mismatch::of(std::uint64_t pixel) const {
  constexpr double never = std::numeric_limits<double>::infinity();
  const double defect = settings_.dead_pixels + settings_.hot_pixels > 0
                            ? random_.uniform(pixel, Purpose::defect)
                            : 1;
  if (defect < settings_.dead_pixels) return {never, never, 0};

  const double positive =
      fixed_threshold(pixel, settings_.positive_threshold, Purpose::positive_threshold);
  const double negative =
      fixed_threshold(pixel, settings_.negative_threshold, Purpose::negative_threshold);
  double leak_rate_hz = settings_.leak_rate_hz;
  if (settings_.leak_spread > 0 && leak_rate_hz > 0) {
    // The mean of all pixels is the rate that is set.
    const double spread = settings_.leak_spread * std::numbers::ln10;
    leak_rate_hz *= std::exp(spread * random_.normal(pixel, Purpose::leak) - spread * spread / 2);
  }
  if (defect < settings_.dead_pixels + settings_.hot_pixels)
    leak_rate_hz +=
        coolest_hz * std::pow(hottest_hz / coolest_hz, random_.uniform(pixel, Purpose::heat));
  return {positive, negative, leak_rate_hz * positive / microseconds_a_second};
}

double Mismatch::leaked(std::uint64_t pixel, const PixelTraits& traits, double noise_rate) const {
  if (traits.leak <= 0) return 0;
  const double longest = traits.positive_threshold / traits.leak;
  const double u = random_.uniform(pixel, Purpose::leak_phase);
  // The age of a reference that noise sets back, and the leak's own event in any case.
  const double age = noise_rate > 0
                         ? -std::log1p(u * std::expm1(-noise_rate * longest)) / noise_rate
                         : u * longest;
  return traits.leak * age;
}

}  // namespace eventcamera
