// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/pixel_array.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "src/dvs/shot_noise.hpp"

namespace eventcamera {
namespace {

/// True if pixels have the same traits with both settings.
bool have_same_traits(const DvsSettings& a, const DvsSettings& b) {
  return a.positive_threshold == b.positive_threshold &&
         a.negative_threshold == b.negative_threshold && a.threshold_sigma == b.threshold_sigma &&
         a.leak_rate == b.leak_rate && a.leak_spread == b.leak_spread &&
         a.hot_pixels == b.hot_pixels && a.dead_pixels == b.dead_pixels && a.seed == b.seed;
}

}  // namespace

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

void PixelArray::set_labels(bool has_labels) {
  last_cause_.reset();
  if (!has_labels) return;
  last_cause_.emplace(width(), height());
  for (int y = 0; y < height(); ++y) std::fill_n(last_cause_->row(y), width(), Cause::unknown);
}

void PixelArray::start(const DvsSettings& settings, ThreadPool& threads) {
  const PixelModel last = std::exchange(model_, PixelModel(settings));
  const bool were_drawn = last.has_threshold_jitter();
  const bool draws = !has_traits_ || were_drawn || !have_same_traits(last.settings, settings);
  has_traits_ = true;
  for_each_row(threads, height(), [&](int y) {
    if (draws) draw_traits(row(y));
    std::fill_n(refractory_left_.row(y), width(), 0.0F);
  });
}

void PixelArray::change(const DvsSettings& settings, ThreadPool& threads) {
  const PixelModel last = std::exchange(model_, PixelModel(settings));
  // Thresholds that events have drawn stay until the seed changes or the jitter ends.
  const bool were_drawn = last.has_threshold_jitter();
  const bool keeps_drawn =
      were_drawn && model_.has_threshold_jitter() && settings.seed == last.settings.seed;
  const bool draws = !have_same_traits(last.settings, settings) || (were_drawn && !keeps_drawn);
  for_each_row(threads, height(), [&](int y) {
    const PixelRow pixels = row(y);
    if (draws && keeps_drawn)
      move_traits(pixels, last);
    else if (draws)
      draw_traits(pixels);
    if (!last.has_bandwidth()) std::copy_n(pixels.target, width(), pixels.signal);
  });
}

void PixelArray::draw_traits(const PixelRow& pixels) {
  for (int x = 0; x < width(); ++x) {
    const auto traits = model_.traits_of(pixels.number_of(x));
    pixels.positive[x] = static_cast<float>(traits.thresholds.positive);
    pixels.negative[x] = static_cast<float>(traits.thresholds.negative);
    pixels.leak[x] = static_cast<float>(traits.leak);
  }
}

void PixelArray::move_traits(const PixelRow& pixels, const PixelModel& last) {
  const auto move = [](float& threshold, double old_fixed, double fixed) {
    const double moved = std::isinf(threshold) || std::isinf(fixed)
                             ? fixed
                             : std::max(threshold + fixed - old_fixed, min_threshold_of(fixed));
    threshold = static_cast<float>(moved);
  };
  for (int x = 0; x < width(); ++x) {
    const auto before = last.traits_of(pixels.number_of(x));
    const auto after = model_.traits_of(pixels.number_of(x));
    move(pixels.positive[x], before.thresholds.positive, after.thresholds.positive);
    move(pixels.negative[x], before.thresholds.negative, after.thresholds.negative);
    pixels.leak[x] = static_cast<float>(after.leak);
  }
}

void PixelArray::settle(const PixelRow& pixels) {
  for (int x = 0; x < width(); ++x) {
    const auto number = pixels.number_of(x);
    const PixelTraits traits{{pixels.positive[x], pixels.negative[x]}, pixels.leak[x]};
    pixels.signal[x] = pixels.target[x];
    pixels.reference[x] = static_cast<float>(pixels.target[x] - model_.leaked(number, traits));
    if (pixels.growth_end[x] != 0) pixels.growth_end[x] = 0;
    pixels.noise_budget[x] =
        draw_noise_budget(model_.random, number, Random::Purpose::first_noise, 0);
  }
}

}  // namespace eventcamera
