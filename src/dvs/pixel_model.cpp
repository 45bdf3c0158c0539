// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/pixel_model.hpp"

#include <cmath>
#include <limits>
#include <numbers>

namespace eventcamera {
namespace {

using Purpose = Random::Purpose;

/// Range of the additional leak rate of hot pixels, log-uniform.
constexpr double min_hot_hz = 10;
constexpr double max_hot_hz = 1000;

Solver solver_for(const DvsSettings& settings) {
  const bool has_side_effects = settings.pixel_latency > 0 || settings.pixel_latency_jitter > 0 ||
                                settings.refractory_reset == RefractoryReset::signal;
  const bool has_many_means = settings.threshold_jitter > 0 && settings.threshold_sigma > 0;
  if (settings.cutoff_frequency == 0 && !has_side_effects && !has_many_means) return Solver::lines;
  const bool thresholds_vary = settings.adaptation > 0 || settings.threshold_jitter > 0;
  return thresholds_vary ? Solver::pixels : Solver::row;
}

}  // namespace

PixelModel::PixelModel(const DvsSettings& settings_of_all)
    : settings(settings_of_all),
      random(settings.seed),
      adaptation(settings),
      mean_thresholds{std::max(settings.positive_threshold, min_threshold),
                      std::max(settings.negative_threshold, min_threshold)},
      gap(std::max(in_microseconds(settings.refractory_period), min_gap)),
      latency(in_microseconds(settings.pixel_latency)),
      latency_jitter(in_microseconds(settings.pixel_latency_jitter)),
      solver(solver_for(settings)) {}

ContrastThresholds PixelModel::fixed_thresholds(std::uint64_t pixel) const {
  if (settings.threshold_sigma <= 0) return mean_thresholds;
  const auto drawn = [&](double mean, Purpose purpose) {
    const double deviation = settings.threshold_sigma * random.normals(pixel, purpose).first;
    return std::max(mean + deviation, min_threshold_of(mean));
  };
  return {drawn(mean_thresholds.positive, Purpose::positive_threshold),
          drawn(mean_thresholds.negative, Purpose::negative_threshold)};
}

ContrastThresholds PixelModel::next_thresholds(std::uint64_t pixel, std::uint64_t counter) const {
  const auto fixed = fixed_thresholds(pixel);
  const auto [first, second] = random.normals(pixel, Purpose::event, counter);
  const double jitter = settings.threshold_jitter;
  return {std::max(fixed.positive + jitter * first, min_threshold_of(fixed.positive)),
          std::max(fixed.negative + jitter * second, min_threshold_of(fixed.negative))};
}

double PixelModel::defect_of(std::uint64_t pixel) const {
  return settings.dead_pixels + settings.hot_pixels > 0 ? random.uniform(pixel, Purpose::defect)
                                                        : 1;
}

bool PixelModel::is_hot(std::uint64_t pixel) const {
  const double defect = defect_of(pixel);
  return defect >= settings.dead_pixels && defect < settings.dead_pixels + settings.hot_pixels;
}

PixelTraits PixelModel::traits_of(std::uint64_t pixel) const {
  constexpr double never_crossed = std::numeric_limits<double>::infinity();
  if (defect_of(pixel) < settings.dead_pixels) return {{never_crossed, never_crossed}, 0};

  const auto thresholds = fixed_thresholds(pixel);
  double leak_rate = settings.leak_rate;
  if (settings.leak_spread > 0 && leak_rate > 0) {
    // Keeps the mean over all pixels at the configured rate.
    const double spread = settings.leak_spread * std::numbers::ln10;
    leak_rate *=
        std::exp(spread * random.normals(pixel, Purpose::leak).first - spread * spread / 2);
  }
  if (is_hot(pixel))
    leak_rate +=
        min_hot_hz * std::pow(max_hot_hz / min_hot_hz, random.uniform(pixel, Purpose::heat));
  return {thresholds, leak_rate * thresholds.positive / 1e6};
}

double PixelModel::leaked(std::uint64_t pixel, const PixelTraits& traits) const {
  if (traits.leak <= 0) return 0;
  const double noise_rate = settings.shot_noise_rate / 1e6;
  const double max_age = traits.thresholds.positive / traits.leak;
  const double u = random.uniform(pixel, Purpose::leak_phase);
  // Age of a reference level that is reset by noise, and at max_age by a leak event.
  const double age = noise_rate > 0
                         ? -std::log1p(u * std::expm1(-noise_rate * max_age)) / noise_rate
                         : u * max_age;
  return traits.leak * age;
}

}  // namespace eventcamera
