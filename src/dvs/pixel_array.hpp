// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "src/core/event.hpp"
#include "src/core/image.hpp"
#include "src/core/label.hpp"
#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/random.hpp"

namespace eventcamera {

/// The properties of one pixel.
struct PixelTraits {
  double positive_threshold;  ///< infinite if the pixel is dead
  double negative_threshold;
  double leak;  ///< fall of the reference per microsecond
};

struct ContrastThresholds {
  double positive;
  double negative;
};

/// A threshold of 0 would fire forever.
inline constexpr double min_threshold = 1e-3;

/// Minimum threshold of pixels that vary around a mean.
inline double min_threshold_of(double mean) {
  return std::max(mean / 10, min_threshold);
}

/// Thresholds without mismatch.
inline ContrastThresholds mean_thresholds(const DvsSettings& settings) {
  return {std::max(settings.positive_threshold, min_threshold),
          std::max(settings.negative_threshold, min_threshold)};
}

/// Differences between pixels, determined by the seed.
class Mismatch {
 public:
  Mismatch(const DvsSettings& settings, const Random& random)
      : settings_(settings), random_(random) {}

  PixelTraits of(std::uint64_t pixel) const;
  bool is_hot(std::uint64_t pixel) const;

  /// Thresholds after event `counter`, if they vary between events.
  ContrastThresholds next_thresholds(std::uint64_t pixel, std::uint64_t counter) const;

  /// Fall of the reference before the first frame, if noise of this rate (1/us) resets it and the
  /// camera has been on for a long time.
  double leaked(std::uint64_t pixel, const PixelTraits& traits, double noise_rate) const;

 private:
  double defect_of(std::uint64_t pixel) const;
  ContrastThresholds fixed_thresholds(std::uint64_t pixel) const;

  const DvsSettings& settings_;
  const Random& random_;
};

/// Traits and state of a row of pixels.
struct PixelRow {
  int y;
  std::uint64_t first_number;  ///< number of the pixel at x = 0

  float* target;     ///< response to the current light
  float* signal;     ///< output of the photoreceptor; only kept if its bandwidth is limited
  float* reference;  ///< level that the signal is compared to
  float* positive;   ///< thresholds; infinite if the pixel is dead
  float* negative;
  float* leak;                  ///< fall of the reference per microsecond
  float* refractory_left;       ///< microseconds until the pixel can fire again; 0 = now
  std::uint32_t* noise_budget;  ///< expected shot noise until the next noise event, 1/noise_unit
  double* growth_end;  ///< end of the thresholds' growth, microseconds since the first frame
  Cause* last_cause;   ///< of the last event; null if events have no labels
};

class PixelArray {
 public:
  PixelArray(int width, int height);

  int width() const { return target_.width(); }
  PixelRow row(int y);

  /// Starts or stops storing the cause of each pixel's last event, for labels.
  void keep_causes(bool are_kept);
  bool keeps_causes() const { return last_cause_.has_value(); }

  /// Draws the thresholds and leak of a row of pixels.
  void draw_traits(int y, const DvsSettings& settings, const Random& random);
  /// The same for settings of the same seed that change while events draw thresholds anew: these
  /// move by as much as those that were drawn first.
  void change_traits(int y, const DvsSettings& from, const DvsSettings& to, const Random& random);

  /// Resets a row as if its target had been constant for a long time, and draws its initial noise
  /// budgets. Refractory periods go on.
  void settle(int y, const DvsSettings& settings, const Random& random);

 private:
  Image<float> target_;
  Image<float> signal_;
  Image<float> reference_;
  Image<float> positive_;
  Image<float> negative_;
  Image<float> leak_;
  Image<float> refractory_left_;
  Image<std::uint32_t> noise_budget_;
  Image<double> growth_end_;
  std::optional<Image<Cause>> last_cause_;
};

}  // namespace eventcamera
