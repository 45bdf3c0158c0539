// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "bench/plain/frame.hpp"
#include "bench/plain/opencv.hpp"

namespace plain {

/// Diff: the pixels of one difference frame move into the next.
class DiffSimulator final : public Simulator {
 public:
  explicit DiffSimulator(const LumaFormat& format)
      : Simulator(format), last_(format.width, format.height), on_(format), off_(format) {}

 private:
  /// One polarity of a difference frame: the pixels over the threshold, in raster order.
  struct Kept {
    std::vector<cv::Point2f> places;
    std::vector<int> differences;  ///< I(i) - I(i-1) at each of them
  };

  /// One polarity of the last difference frame and of this one.
  struct Part {
    explicit Part(const LumaFormat& format) : picture(format.width, format.height) {}

    Kept last;
    Kept now;
    Image<std::uint8_t> picture;  ///< now as a picture, 0 where nothing is kept
    OpenCvTracker tracker;

    void begin_next() {
      for (const auto& place : now.places)
        picture.at(static_cast<int>(place.x), static_cast<int>(place.y)) = 0;
      std::swap(last, now);
      now.places.clear();
      now.differences.clear();
    }

    void keep(int x, int y, int difference) {
      now.places.emplace_back(static_cast<float>(x), static_cast<float>(y));
      now.differences.push_back(difference);
      picture.at(x, y) = static_cast<std::uint8_t>(std::abs(difference));
    }

    bool keeps_near(int left, int top) const {
      for (int y = std::max(top - 1, 0); y <= std::min(top + 1, picture.height() - 1); ++y)
        for (int x = std::max(left - 1, 0); x <= std::min(left + 1, picture.width() - 1); ++x)
          if (picture.at(x, y) != 0) return true;
      return false;
    }
  };

  struct MovingDifference {
    MovingPoint point;
    int difference;
  };

  void start(const LumaView& frame) override {
    last_.assign(frame.as<std::uint8_t>());
    has_difference_ = false;
  }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                EventBuckets& events) override {
    const auto now = frame.as<std::uint8_t>();
    const int m = steps.count();
    const int bands = band_count(now.height);
    events.reset(m, bands);
    // The events of the last step are the pixels that the difference frame keeps.
    fire(last_.view(), now, m, steps.microseconds(m), Thresholds::of(settings, 8), threads(),
         events);
    on_.begin_next();
    off_.begin_next();
    for (int band = 0; band < bands; ++band)
      for (const auto& event : events.bucket(m, band))
        (event.polarity() == Polarity::on ? on_ : off_)
            .keep(event.x, event.y(), now.row(event.y())[event.x] - last_.at(event.x, event.y()));
    on_.tracker.push(on_.picture.view(), threads().threads());
    off_.tracker.push(off_.picture.view(), threads().threads());
    if (has_difference_ && m > 1) {
      moving_.clear();
      follow(on_, m);
      follow(off_, m);
      fire_between(steps, events);
    }
    has_difference_ = true;
    copy(now, last_, threads());
  }

  /// Makes the kept pixels of the last difference frame move towards this one.
  void follow(Part& part, int steps) {
    const auto& kept = part.last;
    for_each_moving(kept.places, part.tracker.track(kept.places, threads().threads()), steps,
                    format(), [&](const MovingPoint& point) {
                      if (part.keeps_near(point.x_at(steps), point.y_at(steps)))
                        moving_.push_back({point, kept.differences[point.index]});
                    });
  }

  /// At each pixel of an interpolated difference frame, the largest of the differences that meet
  /// there fires.
  void fire_between(const StepTimes& steps, EventBuckets& events) {
    const auto size = static_cast<std::size_t>(threads().threads());
    if (frames_.size() != size) frames_.assign(size, {format().width, format().height});
    threads().for_each(steps.count() - 1, [&](int i, int thread) {
      const int j = i + 1;
      auto& frame = frames_[static_cast<std::size_t>(thread)];
      for (const auto& [point, difference] : moving_) {
        int& here = frame.at(point.x_at(j), point.y_at(j));
        if (std::abs(difference) > std::abs(here) || difference == -here)
          here = difference == -here ? std::abs(difference) : difference;
      }
      auto& out = events.bucket(j, 0);
      for (int y = 0; y < frame.height(); ++y) {
        for (int x = 0; x < frame.width(); ++x) {
          const int difference = std::exchange(frame.at(x, y), 0);
          if (difference == 0) continue;
          out.push_back(Event::at(x, y, steps.microseconds(j),
                                  difference > 0 ? Polarity::on : Polarity::off));
        }
      }
    });
  }

  Image<std::uint8_t> last_;
  bool has_difference_ = false;
  Part on_;
  Part off_;
  std::vector<MovingDifference> moving_;
  std::vector<Image<int>> frames_;  ///< by thread; 0 where nothing fires
};

}  // namespace plain
