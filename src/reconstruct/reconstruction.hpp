// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/image.hpp"

namespace eventcamera {

/// Brightness from events alone: a temporal high pass of each pixel, which counts events instead of
/// time, and spatial low passes of the state and of the picture. The temporal filter is FIBAR's
/// (arXiv 2510.20071). See docs/reconstruction.md.
class Reconstruction {
 public:
  struct Settings {
    double cutoff = 40;    ///< period of the temporal high pass, events of a pixel; above 4
    double smoothing = 1;  ///< standard deviation of the picture's low pass, pixels; 0 = none

    friend bool operator==(const Settings&, const Settings&) = default;
  };
  static constexpr double min_cutoff = 5;
  static constexpr double max_smoothing = 5;

  Reconstruction(int width, int height, const Settings& settings);

  /// Adds an event, which must lie inside the picture.
  void add(const AbsoluteEvent& event) {
    float* const level = levels_.row(event.y()) + event.x;
    const auto stride = levels_.stride() / static_cast<std::ptrdiff_t>(sizeof(float));
    const float neighbours = (level[-stride] + level[stride] + level[-1] + level[1]) * 0.25F;
    float& mean = means_.at(event.x, event.y());
    const float sign = event.polarity() == Polarity::on ? 1.0F : -1.0F;
    *level = decay_ * (*level + pull * (neighbours - *level)) + gain_ * (sign - mean);
    mean += mean_gain_ * (sign - mean);
  }

  /// Smooths the picture and measures its contrast. Call before read_row(). The result is bit-exact
  /// on all processors.
  void finish_picture();

  /// Passes the brightness of the pixels of a row to `use`: 0 for the mean, and from -1 to 1 for
  /// `range` times the contrast.
  template <class Use>
  void read_row(int y, const Use& use) const {
    const float* const row = picture_.row(y);
    for (int x = 0; x < picture_.width(); ++x) use(x, row[x] * scale_);
  }

 private:
  static constexpr float pull = 0.2F;  ///< of a pixel to its neighbours, by each of its events
  static constexpr float range = 2.5F;

  float decay_;
  float gain_;
  float mean_gain_;
  std::vector<float> weights_;  ///< of the low pass, from the centre outwards
  Image<float> levels_;         ///< the state of the high pass; 0 outside of the picture
  Image<float> means_;          ///< mean polarity
  Image<float> picture_;
  Image<float> row_;  ///< one row, smoothed vertically, with a margin
  float scale_ = 0;
};

}  // namespace eventcamera
