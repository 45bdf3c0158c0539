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
#include "src/dvs/state_bytes.hpp"

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

  /// Changes settings mid-stream; pixels keep their state. Thresholds that events have drawn move
  /// by as much as those that were drawn first.
  void change(const DvsSettings& settings, ThreadPool& threads);

  /// Resets the pixels as if this frame had been shown for a long time, and draws their initial
  /// noise budgets. Refractory periods go on.
  template <class Pixel>
  void settle(const Image<Pixel>& frame, const LightResponse& response, ThreadPool& threads) {
    for_each_row(threads, height(), [&](int y) {
      const PixelRow pixels = row(y);
      for (int x = 0; x < width(); ++x) pixels.target[x] = response(frame.at(x, y));
      settle(pixels);
    });
  }

  /// Writes all pixels to a StateWriter, or reads them from a StateReader; without the leak, which
  /// is drawn again.
  template <class Archive>
  void serialize(Archive& archive);

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

template <class Archive>
void PixelArray::serialize(Archive& archive) {
  constexpr auto max_level = static_cast<float>(max_state_level);
  constexpr auto is_level = is_within(-max_level, max_level);
  constexpr auto is_threshold = [](float threshold) {
    return std::isinf(threshold) ? threshold > 0 : is_within(1e-4F, max_level)(threshold);
  };
  std::uint8_t has_causes = last_cause_ ? 1 : 0;
  archive.value(has_causes, is_within<std::uint8_t>(0, 1));
  if constexpr (Archive::is_reading) set_labels(has_causes == 1);
  archive.image(target_, is_level);
  archive.image(signal_, is_level);
  archive.image(reference_, is_level);
  archive.image(positive_, is_threshold);
  archive.image(negative_, is_threshold);
  archive.image(refractory_left_, is_within(0.0F, static_cast<float>(max_state_time)));
  archive.image(noise_budget_, is_anything);
  archive.image(growth_end_, is_within(0.0, max_state_clock));
  if (last_cause_) archive.image(*last_cause_, is_within(Cause::unknown, Cause::exposure_pulse));
}

}  // namespace eventcamera
