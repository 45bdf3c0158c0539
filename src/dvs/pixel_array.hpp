// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "src/core/event.hpp"
#include "src/core/image.hpp"
#include "src/core/label.hpp"
#include "src/core/thread_pool.hpp"
#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/light_response.hpp"
#include "src/dvs/pixel_model.hpp"

namespace eventcamera {

/// Pixels [first, last) of a row.
struct Run {
  int y;
  int first;
  int last;

  int width() const { return last - first; }
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

  std::uint64_t number_of(int x) const { return first_number + static_cast<std::uint64_t>(x); }
};

/// The pixels, and the model that they follow.
class PixelArray {
 public:
  PixelArray(int width, int height);

  int width() const { return target_.width(); }
  int height() const { return target_.height(); }
  PixelRow row(int y);
  const PixelModel& model() const { return model_; }

  /// Starts or stops storing the cause of each pixel's last event, for labels.
  void set_labels(bool has_labels);
  bool has_labels() const { return last_cause_.has_value(); }

  /// Starts over with these settings, all pixels ready to fire; settle() must follow.
  void start(const DvsSettings& settings, ThreadPool& threads);

  /// Changes settings mid-stream; pixels keep their state. Thresholds drawn by events shift by as
  /// much as the initial ones.
  void change(const DvsSettings& settings, ThreadPool& threads);

  /// Resets the pixels as if this frame had been shown for a long time, and draws their initial
  /// noise budgets. Refractory periods continue.
  template <class Pixel>
  void settle(const Image<Pixel>& frame, const LightResponse& response, ThreadPool& threads) {
    for_each_row(threads, height(), [&](int y) {
      const PixelRow pixels = row(y);
      for (int x = 0; x < width(); ++x) pixels.target[x] = response(frame.at(x, y));
      settle(pixels);
    });
  }

 private:
  void draw_traits(const PixelRow& pixels);
  void move_traits(const PixelRow& pixels, const PixelModel& last);
  void settle(const PixelRow& pixels);

  PixelModel model_{DvsSettings{}};
  bool has_traits_ = false;
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
