// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/reconstruct/complementary_filter.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace eventcamera {
namespace {

/// Added to grey levels before the logarithm, as by eventsim-dvs.
constexpr double offset = 0.05 * 255;

const auto responses = [] {
  std::array<float, 256> table{};
  for (std::size_t grey = 0; grey < table.size(); ++grey)
    table[grey] = static_cast<float>(std::log1p(static_cast<double>(grey) / offset));
  return table;
}();

/// Accurate to 0.05 grey levels.
constexpr int levels_per_unit = 4096;

/// Grey levels by response, up to log(1 + 255 / offset).
const auto greys = [] {
  std::array<std::uint8_t, static_cast<std::size_t>(3.045 * levels_per_unit)> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    const double grey = offset * std::expm1(static_cast<double>(i) / levels_per_unit);
    table[i] = static_cast<std::uint8_t>(std::lround(std::min(grey, 255.0)));
  }
  return table;
}();

/// Later changes are scaled up to e^max_exponent; then all differences are scaled down.
constexpr double max_exponent = 16;

}  // namespace

ComplementaryFilter::ComplementaryFilter(const ImageView<std::uint8_t>& frame, Microseconds t,
                                         const Settings& settings)
    : validator_(frame.width, frame.height),
      origin_(t),
      frame_(frame.width, frame.height),
      differences_(frame.width, frame.height) {
  configure(settings);
  set_frame(frame, t);
  for (int y = 0; y < frame.height; ++y) std::fill_n(differences_.row(y), frame.width, 0.0F);
}

void ComplementaryFilter::configure(const Settings& settings) {
  const double rate = 2 * std::numbers::pi * 1e-6 * settings.cutoff;
  if (rate != rate_) decay_to(validator_.passed());
  rate_ = rate;
  on_ = static_cast<float>(settings.positive_threshold);
  off_ = static_cast<float>(settings.negative_threshold);
  last_ = origin_;
  steps_ = {-off_, on_};
}

void ComplementaryFilter::decay_to(Microseconds t) {
  const auto factor = static_cast<float>(std::exp(-exponent(t)));
  for (int y = 0; y < differences_.height(); ++y) {
    float* const row = differences_.row(y);
    for (int x = 0; x < differences_.width(); ++x) row[x] *= factor;
  }
  origin_ = std::max(origin_, t);
  last_ = origin_;
  steps_ = {-off_, on_};
}

InvalidEvents ComplementaryFilter::add(std::span<const Event> events, Microseconds start,
                                       Microseconds max_t) {
  return validator_.for_each_valid(events, start, max_t, [this](const AbsoluteEvent& event) {
    if (event.t != last_) {
      if (exponent(event.t) > max_exponent) decay_to(event.t);
      last_ = event.t;
      const auto growth = static_cast<float>(std::exp(exponent(event.t)));
      steps_ = {-off_ * growth, on_ * growth};
    }
    differences_.at(event.x, event.y()) += steps_[event.polarity() == Polarity::on ? 1 : 0];
  });
}

void ComplementaryFilter::set_frame(const ImageView<std::uint8_t>& frame, Microseconds t) {
  validator_.pass(t);
  decay_to(t);
  for (int y = 0; y < frame.height; ++y) {
    const std::uint8_t* const in = frame.row(y);
    float* const last = frame_.row(y);
    float* const difference = differences_.row(y);
    for (int x = 0; x < frame.width; ++x) {
      const float response = responses[in[x]];
      difference[x] += last[x] - response;
      last[x] = response;
    }
  }
}

void ComplementaryFilter::draw(Microseconds t, std::byte* picture, std::ptrdiff_t stride) const {
  const auto factor = static_cast<float>(std::exp(-exponent(t)));
  constexpr auto max = static_cast<float>(greys.size() - 1);
  for (int y = 0; y < frame_.height(); ++y) {
    const float* const last = frame_.row(y);
    const float* const difference = differences_.row(y);
    auto* const out = reinterpret_cast<std::uint8_t*>(picture + y * stride);
    for (int x = 0; x < frame_.width(); ++x) {
      const float level = (last[x] + factor * difference[x]) * levels_per_unit + 0.5F;
      out[x] = greys[static_cast<std::size_t>(std::clamp(level, 0.0F, max))];
    }
  }
}

}  // namespace eventcamera
