// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "bench/naive/frame.hpp"
#include "bench/naive/opencv.hpp"
#include "src/core/thread_pool.hpp"

namespace naive {

/// Diff: moves the pixels of one difference frame into the next.
class DiffSimulator final : public Simulator {
 public:
  explicit DiffSimulator(const LumaFormat& format) : Simulator(format) {}

 private:
  /// One polarity of the difference frame as an image, 0 where nothing fires.
  struct PolarityImage {
    int sign;
    Image<std::uint8_t> image;
    OpenCvTracker tracker;
  };

  struct MovingDifference {
    MovingPoint point;
    int difference;
  };

  void start(const LumaView& frame) override {
    last_.assign(frame.as<std::uint8_t>());
    difference_ = {format().width, format().height};
  }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                StepBuckets& events) override {
    const auto now = frame.as<std::uint8_t>();
    const int m = steps.count();
    const auto thresholds = Thresholds::of(settings, 8);
    events.reset(m, band_count(now.height));
    fire(last_.view(), now, m, steps.microseconds(m), thresholds, threads(), events);

    std::swap(before_, difference_);
    for_each_row(threads(), now.height, [&](int y) {
      for (int x = 0; x < now.width; ++x) {
        const int change = now.row(y)[x] - last_.at(x, y);
        const bool fires = change > thresholds.positive || -change > thresholds.negative;
        const int difference = fires ? change : 0;
        difference_.at(x, y) = difference;
        for (auto& polarity : polarities_)
          polarity.image.at(x, y) =
              static_cast<std::uint8_t>(std::max(0, polarity.sign * difference));
      }
    });
    moving_.clear();
    for (auto& polarity : polarities_) {
      polarity.tracker.push(polarity.image.view(), threads().threads());
      if (m > 1) follow(polarity, m);
    }
    fire_between(steps, events);
    copy(now, last_, threads());
  }

  /// Moves the pixels of one polarity that end next to a pixel of that polarity.
  void follow(PolarityImage& polarity, int steps) {
    points_.clear();
    for (int y = 0; y < before_.height(); ++y)
      for (int x = 0; x < before_.width(); ++x)
        if (polarity.sign * before_.at(x, y) > 0)
          points_.emplace_back(static_cast<float>(x), static_cast<float>(y));
    const auto arrives = [&](int end_x, int end_y) {
      const auto& image = polarity.image;
      for (int y = std::max(end_y - 1, 0); y <= std::min(end_y + 1, image.height() - 1); ++y)
        for (int x = std::max(end_x - 1, 0); x <= std::min(end_x + 1, image.width() - 1); ++x)
          if (image.at(x, y) != 0) return true;
      return false;
    };
    for_each_moving(points_, polarity.tracker.track(points_, threads().threads()), steps, format(),
                    [&](const MovingPoint& point) {
                      if (arrives(point.x_at(steps), point.y_at(steps)))
                        moving_.push_back({point, before_.at(point.x, point.y)});
                    });
  }

  /// Fires the largest difference at each pixel of an interpolated frame.
  void fire_between(const StepTimes& steps, StepBuckets& events) {
    while (static_cast<int>(frames_.size()) < threads().threads())
      frames_.emplace_back(format().width, format().height);
    threads().for_each(steps.count() - 1, [&](int i, int thread) {
      const int j = i + 1;
      auto& frame = frames_[static_cast<std::size_t>(thread)];
      for (const auto& [point, difference] : moving_) {
        int& here = frame.at(point.x_at(j), point.y_at(j));
        if (std::abs(difference) > std::abs(here) || difference == -here)
          here = difference == -here ? std::abs(difference) : difference;
      }
      for (int y = 0; y < frame.height(); ++y) {
        int* row = frame.row(y);
        for (int x = 0; x < frame.width(); ++x) {
          if (row[x] == 0) continue;
          events.bucket(j, 0).push_back(
              Event::at(x, y, steps.microseconds(j), row[x] > 0 ? Polarity::on : Polarity::off));
          row[x] = 0;
        }
      }
    });
  }

  Image<std::uint8_t> last_{format().width, format().height};
  Image<int> before_{format().width, format().height};
  Image<int> difference_{format().width, format().height};
  PolarityImage polarities_[2] = {{1, {format().width, format().height}, {}},
                                  {-1, {format().width, format().height}, {}}};
  std::vector<cv::Point2f> points_;
  std::vector<MovingDifference> moving_;
  std::vector<Image<int>> frames_;  ///< by thread; 0 where nothing fires
};

}  // namespace naive
