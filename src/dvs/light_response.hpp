// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"
#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/exposure_gain.hpp"

namespace eventcamera {

/// Light of a luma value, both relative to white: the same value or, if `linear_light`, with the
/// sRGB transfer function (IEC 61966-2-1) inverted.
inline double light_of(double luma, bool linear_light) {
  if (!linear_light) return luma;
  return luma <= 0.04045 ? luma / 12.92 : std::pow((luma + 0.055) / 1.055, 2.4);
}

/// Inverse of light_of().
inline double luma_of(double light, bool linear_light) {
  if (!linear_light) return light;
  return light <= 0.04045 / 12.92 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
}

/// Response of the photoreceptor to the luma of frames, with the exposure divided out.
class LightResponse {
 public:
  explicit LightResponse(int frame_bits) : frame_bits_(frame_bits) {}

  /// Applies to the next frames. Starts over with the exposure unless has_units_of().
  void set(const DvsSettings& settings);
  /// True if the responses with these settings are comparable to those so far.
  bool has_units_of(const DvsSettings& settings) const;

  void set_range(bool is_narrow);

  /// Sets the exposure of the next frame to 1.
  void restart();

  /// Updates the exposure if `exposure_compensation` is set. Returns its gain since the last frame.
  template <class Pixel>
  double compensate(const ImageView<Pixel>& last, const ImageView<Pixel>& now, ThreadPool& threads);

  /// Exposure of the last frame; the first frame has 1.
  double gain() const { return gain_; }

  /// Bit depth of the pixels' luma: 8-bit frames have 16 bits while they move.
  int bits() const {
    return settings_.upsampling == Upsampling::motion && frame_bits_ == 8 ? 16 : frame_bits_;
  }
  bool is_widened() const { return bits() != frame_bits_; }

  const std::vector<float>& table() const { return table_; }  ///< by luma of bits()
  int white() const { return static_cast<int>(table_.size()) - 1; }

  /// Response to the luma of a frame.
  float operator()(int luma) const {
    const int seen = is_widened() ? 257 * luma : luma;
    return table_[std::min(seen, white())];
  }

 private:
  void make_table();

  int frame_bits_;
  DvsSettings settings_;
  bool is_narrow_ = false;
  double gain_ = 1;
  std::optional<ExposureGain> exposure_gain_;
  std::vector<float> table_;
};

}  // namespace eventcamera
