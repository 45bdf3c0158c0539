// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/pixel_array.hpp"

#include <algorithm>
#include <cmath>

#include "src/dvs/shot_noise.hpp"

namespace eventcamera {
namespace {

using Purpose = Random::Purpose;

/// Range of the additional leak rate of hot pixels, log-uniform.
constexpr double min_hot_hz = 10;
constexpr double max_hot_hz = 1000;

}  // namespace

ContrastThresholds Mismatch::fixed_thresholds(std::uint64_t pixel) const {
  const auto mean = mean_thresholds(settings_);
  if (settings_.threshold_sigma <= 0) return mean;
  const auto drawn = [&](double threshold, Purpose purpose) {
    const double deviation = settings_.threshold_sigma * random_.normals(pixel, purpose).first;
    return std::max(threshold + deviation, min_threshold_of(threshold));
  };
  return {drawn(mean.positive, Purpose::positive_threshold),
          drawn(mean.negative, Purpose::negative_threshold)};
}

ContrastThresholds Mismatch::next_thresholds(std::uint64_t pixel, std::uint64_t counter) const {
  const auto mean = fixed_thresholds(pixel);
  const auto [first, second] = random_.normals(pixel, Purpose::event, counter);
  const double jitter = settings_.threshold_jitter;
  return {std::max(mean.positive + jitter * first, min_threshold_of(mean.positive)),
          std::max(mean.negative + jitter * second, min_threshold_of(mean.negative))};
}

double Mismatch::defect_of(std::uint64_t pixel) const {
  return settings_.dead_pixels + settings_.hot_pixels > 0 ? random_.uniform(pixel, Purpose::defect)
                                                          : 1;
}

bool Mismatch::is_hot(std::uint64_t pixel) const {
  const double defect = defect_of(pixel);
  return defect >= settings_.dead_pixels && defect < settings_.dead_pixels + settings_.hot_pixels;
}

PixelTraits Mismatch::of(std::uint64_t pixel) const {
  if (defect_of(pixel) < settings_.dead_pixels) return {never, never, 0};

  const auto [positive, negative] = fixed_thresholds(pixel);
  double leak_rate = settings_.leak_rate;
  if (settings_.leak_spread > 0 && leak_rate > 0) {
    // Keeps the mean over all pixels at the configured rate.
    const double spread = settings_.leak_spread * std::numbers::ln10;
    leak_rate *=
        std::exp(spread * random_.normals(pixel, Purpose::leak).first - spread * spread / 2);
  }
  if (is_hot(pixel))
    leak_rate +=
        min_hot_hz * std::pow(max_hot_hz / min_hot_hz, random_.uniform(pixel, Purpose::heat));
  return {positive, negative, leak_rate * positive / 1e6};
}

double Mismatch::leaked(std::uint64_t pixel, const PixelTraits& traits, double noise_rate) const {
  if (traits.leak <= 0) return 0;
  const double max_age = traits.positive_threshold / traits.leak;
  const double u = random_.uniform(pixel, Purpose::leak_phase);
  // Age of a reference level that is reset by noise, and at max_age by a leak event.
  const double age = noise_rate > 0
                         ? -std::log1p(u * std::expm1(-noise_rate * max_age)) / noise_rate
                         : u * max_age;
  return traits.leak * age;
}

PixelArray::PixelArray(int width, int height)
    : target_(width, height),
      signal_(width, height),
      reference_(width, height),
      positive_(width, height),
      negative_(width, height),
      leak_(width, height),
      refractory_left_(width, height),
      noise_budget_(width, height),
      growth_end_(width, height) {}

PixelRow PixelArray::row(int y) {
  return {y,
          static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(width()),
          target_.row(y),
          signal_.row(y),
          reference_.row(y),
          positive_.row(y),
          negative_.row(y),
          leak_.row(y),
          refractory_left_.row(y),
          noise_budget_.row(y),
          growth_end_.row(y),
          last_cause_ ? last_cause_->row(y) : nullptr};
}

void PixelArray::keep_causes(bool are_kept) {
  last_cause_.reset();
  if (!are_kept) return;
  last_cause_.emplace(width(), growth_end_.height());
  for (int y = 0; y < last_cause_->height(); ++y)
    std::fill_n(last_cause_->row(y), width(), Cause::unknown);
}

void PixelArray::draw_traits(int y, const DvsSettings& settings, const Random& random) {
  const Mismatch mismatch(settings, random);
  const PixelRow pixels = row(y);
  for (int x = 0; x < width(); ++x) {
    const auto traits = mismatch.of(pixels.first_number + static_cast<std::uint64_t>(x));
    pixels.positive[x] = static_cast<float>(traits.positive_threshold);
    pixels.negative[x] = static_cast<float>(traits.negative_threshold);
    pixels.leak[x] = static_cast<float>(traits.leak);
  }
}

void PixelArray::change_traits(int y, const DvsSettings& from, const DvsSettings& to,
                               const Random& random) {
  const Mismatch before(from, random);
  const Mismatch after(to, random);
  const PixelRow pixels = row(y);
  const auto move = [](float& threshold, double old_fixed, double fixed) {
    const double moved = std::isinf(threshold) || std::isinf(fixed)
                             ? fixed
                             : std::max(threshold + fixed - old_fixed, min_threshold_of(fixed));
    threshold = static_cast<float>(moved);
  };
  for (int x = 0; x < width(); ++x) {
    const auto number = pixels.first_number + static_cast<std::uint64_t>(x);
    const auto old_traits = before.of(number);
    const auto traits = after.of(number);
    move(pixels.positive[x], old_traits.positive_threshold, traits.positive_threshold);
    move(pixels.negative[x], old_traits.negative_threshold, traits.negative_threshold);
    pixels.leak[x] = static_cast<float>(traits.leak);
  }
}

void PixelArray::settle(int y, const DvsSettings& settings, const Random& random) {
  const Mismatch mismatch(settings, random);
  const double noise_rate = settings.shot_noise_rate / 1e6;
  const PixelRow pixels = row(y);
  for (int x = 0; x < width(); ++x) {
    const auto number = pixels.first_number + static_cast<std::uint64_t>(x);
    const PixelTraits traits{pixels.positive[x], pixels.negative[x], pixels.leak[x]};
    pixels.signal[x] = pixels.target[x];
    pixels.reference[x] =
        static_cast<float>(pixels.target[x] - mismatch.leaked(number, traits, noise_rate));
    if (pixels.growth_end[x] != 0) pixels.growth_end[x] = 0;
    pixels.noise_budget[x] = draw_noise_budget(random, number, Purpose::first_noise, 0);
  }
}

}  // namespace eventcamera
