// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/sparse.hpp"

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "src/core/luma.hpp"
#include "src/simulate/difference.hpp"
#include "src/simulate/motion.hpp"

namespace eventcamera {
namespace {

/// A tracked pixel in motion, with its brightness.
template <class Pixel>
struct MovingPixel {
  MovingPoint point;
  Pixel brightness;
};

/// Two frames and the pixels that move between them.
template <class Pixel>
struct Interval {
  ImageView<Pixel> last;
  ImageView<Pixel> now;
  std::span<const MovingPixel<Pixel>> pixels;  ///< in raster order of their start points
  const std::vector<char>& touched;            ///< rows that a pixel starts in or crosses
};

/// Draws the interpolated frames of an interval, one after another.
template <class Pixel>
class Painter {
 public:
  Painter(int width, int height) : between_(width, height), before_(width, height) {}

  /// Appends the events of steps first ... last to their buckets.
  void fire(const Interval<Pixel>& interval, int first, int last, const StepTimes& steps,
            const Thresholds& thresholds, EventBuckets& events) {
    paint(interval, first - 1);
    for (int j = first; j <= last; ++j) {
      std::swap(before_, between_);
      const bool ends = j == steps.count();
      if (!ends) paint(interval, j);
      auto& out = events.pixels(j, 0);
      out.begin(steps.microseconds(j));
      for (int y = 0; y < interval.now.height; ++y) {
        const bool touched = interval.touched[static_cast<std::size_t>(y)] != 0;
        if (!touched && !ends) continue;
        fire_differences(touched ? before_.row(y) : interval.last.row(y),
                         ends ? interval.now.row(y) : between_.row(y), interval.now.width, y,
                         thresholds, out);
      }
    }
  }

 private:
  /// Draws the touched rows of the frame of step j into between_.
  void paint(const Interval<Pixel>& interval, int j) {
    for (int y = 0; y < between_.height(); ++y)
      if (interval.touched[static_cast<std::size_t>(y)] != 0)
        between_.assign_row(y, interval.last.row(y));
    places_.resize(interval.pixels.size());
    auto* place = places_.data();
    for (const auto& pixel : interval.pixels) {
      const auto [x, y] = pixel.point.start;
      const auto [to_x, to_y] = pixel.point.at(j);
      *place++ = &between_.at(to_x, to_y);
      if (to_x != x || to_y != y) between_.at(x, y) = interval.now.row(y)[x];
    }
    place = places_.data();
    for (const auto& pixel : interval.pixels) **place++ = pixel.brightness;
  }

  Image<Pixel> between_;
  Image<Pixel> before_;
  std::vector<Pixel*> places_;  ///< targets of the moving pixels, in between_
};

template <class Pixel>
class SparseSimulator final : public Simulator {
 public:
  explicit SparseSimulator(const LumaFormat& format)
      : Simulator(format),
        last_(format.width, format.height),
        touched_(static_cast<std::size_t>(format.height)) {}

 private:
  void start(const LumaView& frame) override {
    last_.assign(frame.as<Pixel>());
    tracker_.push(grey_.of(frame), threads());
  }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                EventBuckets& events) override {
    const auto now = frame.as<Pixel>();
    const auto thresholds = Thresholds::of(settings, format().bits);
    find_changed(now, std::min(thresholds.positive, thresholds.negative));
    tracker_.push(grey_.of(frame), threads());
    follow_changed(steps.count());

    const int m = steps.count();
    events.reset(m, 1);
    const Interval<Pixel> interval{last_.view(), now, pixels_, touched_};
    // Each thread draws consecutive steps, so that all frames but the first are used twice.
    const int runs = std::min(threads().threads(), m);
    while (static_cast<int>(painters_.size()) < runs)
      painters_.emplace_back(format().width, format().height);
    threads().for_each(runs, [&](int run, int) {
      painters_[static_cast<std::size_t>(run)].fire(
          interval, m * run / runs + 1, m * (run + 1) / runs, steps, thresholds, events);
    });
    last_.assign(now);
  }

  /// Finds the pixels whose change exceeds `threshold`, in raster order.
  void find_changed(const ImageView<Pixel>& now, int threshold) {
    changes_.reset(1, band_count(now.height));
    fire_differences(last_.view(), now, 1, 0, {threshold, threshold}, threads(), changes_);
    changed_.clear();
    for (int band = 0; band < changes_.bands(); ++band)
      changes_.visit_band(band, [this](std::span<const Event> changes) {
        for (const auto& change : changes) changed_.push_back({change.x, change.y()});
      });
  }

  /// Tracks the changed pixels into this frame.
  void follow_changed(int steps) {
    pixels_.clear();
    std::fill(touched_.begin(), touched_.end(), 0);
    const auto tracks = tracker_.track(changed_, threads());
    for (std::size_t i = 0; i < changed_.size(); ++i) {
      const auto point =
          moving_point(changed_[i], tracks[i], steps, format().width, format().height);
      if (!point) continue;
      pixels_.push_back({*point, last_.at(point->start.x, point->start.y)});
      const auto [top, bottom] = std::minmax({point->start.y, point->at(steps).y});
      for (int y = top; y <= bottom; ++y) touched_[static_cast<std::size_t>(y)] = 1;
    }
  }

  Image<Pixel> last_;
  PointTracker tracker_;
  Grey8 grey_;
  EventBuckets changes_;
  std::vector<Point> changed_;
  std::vector<MovingPixel<Pixel>> pixels_;
  std::vector<char> touched_;
  std::vector<Painter<Pixel>> painters_;  ///< one per thread
};

}  // namespace

std::unique_ptr<Simulator> make_sparse_simulator(const LumaFormat& format) {
  if (format.bits > 8) return std::make_unique<SparseSimulator<std::uint16_t>>(format);
  return std::make_unique<SparseSimulator<std::uint8_t>>(format);
}

}  // namespace eventcamera
