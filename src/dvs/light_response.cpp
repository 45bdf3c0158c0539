// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/light_response.hpp"

#include <algorithm>

namespace eventcamera {
namespace {

/// Limit of the gain since the first frame, in case errors of many estimates add up.
constexpr double max_total_gain = 64;

/// Light factor of bright luma: `overexposed_light` at white, falling to 1 over the 20 (of 255)
/// grey levels below.
double overexposure_of(double luma, bool is_narrow, double overexposed_light) {
  constexpr double width = 20.0 / 255;
  const double white = is_narrow ? 235.0 / 255 : 1;
  return 1 + (overexposed_light - 1) * std::clamp((luma - white) / width + 1, 0.0, 1.0);
}

/// Response of the photoreceptor to light, white is 1.
double response_of(double light, Response response, double log_eps) {
  constexpr double linear_up_to = 20;  // 8-bit grey levels, as in v2e
  if (response == Response::log) return std::log(log_eps + light);
  if (response == Response::linear) return std::log(255.0) * light;
  const double x = 255 * light;
  return x <= linear_up_to ? x * std::log(linear_up_to) / linear_up_to : std::log(x);
}

}  // namespace

bool LightResponse::has_units_of(const DvsSettings& settings) const {
  return !table_.empty() && settings.linear_light == settings_.linear_light &&
         settings.exposure_compensation == settings_.exposure_compensation &&
         settings.response == settings_.response && settings.log_eps == settings_.log_eps &&
         settings.overexposed_light == settings_.overexposed_light;
}

void LightResponse::set(const DvsSettings& settings) {
  const bool starts_over = !has_units_of(settings);
  const bool is_of_other_bits = settings.upsampling != settings_.upsampling;
  settings_ = settings;
  if (starts_over) {
    gain_ = 1;
    exposure_gain_.reset();
  }
  if (starts_over || is_of_other_bits) make_table();
}

void LightResponse::set_range(bool is_narrow) {
  if (is_narrow == is_narrow_) return;
  is_narrow_ = is_narrow;
  if (!table_.empty()) make_table();
}

void LightResponse::restart() {
  if (gain_ == 1) return;
  gain_ = 1;
  make_table();
}

template <class Pixel>
double LightResponse::compensate(const ImageView<Pixel>& last, const ImageView<Pixel>& now,
                                 ThreadPool& threads) {
  if (!settings_.exposure_compensation) return 1;
  if (!exposure_gain_) exposure_gain_.emplace(frame_bits_, settings_.linear_light);
  const double gain = exposure_gain_->between(last, now, threads);
  const double total = gain_ * gain;
  if (gain == 1 || std::max(total, 1 / total) > max_total_gain) return 1;
  gain_ = total;
  make_table();
  return gain;
}

template double LightResponse::compensate(const ImageView<std::uint8_t>&,
                                          const ImageView<std::uint8_t>&, ThreadPool&);
template double LightResponse::compensate(const ImageView<std::uint16_t>&,
                                          const ImageView<std::uint16_t>&, ThreadPool&);

void LightResponse::make_table() {
  table_.resize(std::size_t{1} << bits());
  for (std::size_t i = 0; i < table_.size(); ++i) {
    const double luma = static_cast<double>(i) / white();
    const double light = light_of(luma, settings_.linear_light) *
                         overexposure_of(luma, is_narrow_, settings_.overexposed_light) / gain_;
    table_[i] = static_cast<float>(response_of(light, settings_.response, settings_.log_eps));
  }
}

}  // namespace eventcamera
