// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdlib>

#include "bench/naive/frame.hpp"
#include "bench/naive/opencv.hpp"

namespace naive {

/// Sparse interpolation: tracks only the changed pixels.
class SparseSimulator final : public Simulator {
 public:
  explicit SparseSimulator(const LumaFormat& format)
      : Simulator(format),
        last_(format.width, format.height),
        between_{Image<std::uint8_t>(format.width, format.height),
                 Image<std::uint8_t>(format.width, format.height)},
        changed_in_band_(static_cast<std::size_t>(band_count(format.height))) {}

 private:
  void start(const LumaView& frame) override {
    last_.assign(frame.as<std::uint8_t>());
    tracker_.push(frame.as<std::uint8_t>(), threads().threads());
  }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                StepBuckets& events) override {
    const auto now = frame.as<std::uint8_t>();
    const int m = steps.count();
    const auto thresholds = Thresholds::of(settings, 8);
    find_changed(now, std::min(thresholds.positive, thresholds.negative));
    tracker_.push(now, threads().threads());
    points_.clear();
    for_each_moving(changed_, tracker_.track(changed_, threads().threads()), m, format(),
                    [&](const MovingPoint& point) { points_.push_back(point); });

    events.reset(m, band_count(now.height));
    auto before = last_.view();
    for (int j = 1; j < m; ++j) {
      auto& between = between_[j % 2];
      interpolate(now, j, between);
      fire(before, between.view(), j, steps.microseconds(j), thresholds, threads(), events);
      before = between.view();
    }
    fire(before, now, m, steps.microseconds(m), thresholds, threads(), events);
    copy(now, last_, threads());
  }

  /// The pixels whose change exceeds `threshold`, in raster order.
  void find_changed(const FrameView& now, int threshold) {
    threads().for_each(band_count(now.height), [&](int band, int) {
      auto& changed = changed_in_band_[static_cast<std::size_t>(band)];
      changed.clear();
      const BandRows rows(band, now.height);
      for (int y = rows.first; y < rows.last; ++y)
        for (int x = 0; x < now.width; ++x)
          if (std::abs(now.row(y)[x] - last_.at(x, y)) > threshold)
            changed.emplace_back(static_cast<float>(x), static_cast<float>(y));
    });
    changed_.clear();
    for (const auto& changed : changed_in_band_)
      changed_.insert(changed_.end(), changed.begin(), changed.end());
  }

  /// The interpolated frame of step j.
  void interpolate(const FrameView& now, int j, Image<std::uint8_t>& between) {
    copy(last_.view(), between, threads());
    for (const auto& point : points_)
      if (point.x_at(j) != point.x || point.y_at(j) != point.y)
        between.at(point.x, point.y) = now.row(point.y)[point.x];
    for (const auto& point : points_)
      between.at(point.x_at(j), point.y_at(j)) = last_.at(point.x, point.y);
  }

  Image<std::uint8_t> last_;
  Image<std::uint8_t> between_[2];
  OpenCvTracker tracker_;
  std::vector<std::vector<cv::Point2f>> changed_in_band_;
  std::vector<cv::Point2f> changed_;
  std::vector<MovingPoint> points_;
};

}  // namespace naive
