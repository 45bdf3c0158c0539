// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/simulators.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <utility>
#include <vector>

#include "src/core/luma.hpp"
#include "src/simulate/difference.hpp"
#include "src/simulate/moving_points.hpp"

namespace eventcamera {
namespace {

/// Background uncovered where a moving pixel started.
template <class Pixel>
struct Uncovered {
  std::uint16_t x;
  std::uint16_t y;
  Pixel brightness;
};

/// Tracked pixels that start in one band of rows, in raster order. On its own cache lines, because
/// threads fill neighbouring bands concurrently.
template <class Pixel>
struct alignas(64) MovingBand {
  MovingPoints points;
  std::vector<Pixel> brightness;
  std::vector<std::vector<Uncovered<Pixel>>> uncovered;  ///< by step
  int top;  ///< the pixels start in and cross rows [top, bottom)
  int bottom;
};

/// First step at which a pixel has left its start, at most `steps`.
int departure_of(const MovingPoint& point, int steps) {
  const auto along = [&](Motion motion) {
    constexpr int half = 1 << 15;
    return motion == 0 ? steps : 1 + (half - (motion > 0 ? 1 : 0)) / std::abs(motion);
  };
  return std::min({along(point.dx), along(point.dy), steps});
}

/// Two frames and the pixels that move between them.
template <class Pixel>
struct Interval {
  ImageView<Pixel> last;
  ImageView<Pixel> now;
  std::span<const MovingBand<Pixel>> bands;
  const std::vector<char>& touched;  ///< rows that pixels of any band start in or cross
};

/// Draws the interpolated frames of an interval, one after another.
template <class Pixel>
class Painter {
 public:
  Painter(int width, int height) : still_(width, height) {
    for (int i = 0; i <= steps_at_once; ++i) frames_.emplace_back(width, height);
  }

  /// Appends the events of steps first ... last to their buckets.
  void fire(const Interval<Pixel>& interval, int first, int last, const StepTimes& steps,
            const Thresholds& thresholds, StepBuckets& events) {
    for_each_touched(interval, [&](int y) { still_.assign_row(y, interval.last.row(y)); });
    for (int j = 1; j < first - 1; ++j) uncover(interval, j);
    paint(interval, first - 1, 0, 1);
    for (int begin = first; begin <= last; begin += steps_at_once) {
      const int count = std::min(steps_at_once, last + 1 - begin);
      paint(interval, begin, 1, std::min(count, steps.count() - begin));
      for (int i = 0; i < count; ++i) {
        const int j = begin + i;
        const bool ends = j == steps.count();
        const auto at = static_cast<std::size_t>(i);
        auto& out = events.pixels(j, 0);
        out.begin(steps.microseconds(j));
        for (int y = 0; y < interval.now.height; ++y) {
          const bool touched = interval.touched[y] != 0;
          if (!touched && !ends) continue;
          fire_differences(touched ? frames_[at].row(y) : interval.last.row(y),
                           ends ? interval.now.row(y) : frames_[at + 1].row(y), interval.now.width,
                           y, thresholds, out);
        }
      }
      std::swap(frames_.front(), frames_[count]);
    }
  }

 private:
  template <class Body>
  static void for_each_touched(const Interval<Pixel>& interval, const Body& body) {
    for (int y = 0; y < interval.now.height; ++y)
      if (interval.touched[y] != 0) body(y);
  }

  /// Draws the background that the pixels uncover in step j into still_.
  void uncover(const Interval<Pixel>& interval, int j) {
    for (const auto& band : interval.bands)
      for (const auto& [x, y, brightness] : band.uncovered[j]) still_.at(x, y) = brightness;
  }

  /// Draws the touched rows of the frames of steps begin ... begin + count - 1 into frames_[to] and
  /// the following ones.
  void paint(const Interval<Pixel>& interval, int begin, std::size_t to, int count) {
    const auto frames = std::span(frames_).subspan(to, static_cast<std::size_t>(count));
    int j = begin;
    for (auto& frame : frames) {
      uncover(interval, j++);
      for_each_touched(interval, [&](int y) { frame.assign_row(y, still_.row(y)); });
    }
    if (begin == 0) return;  // nothing has moved yet
    const int stride = static_cast<int>(still_.stride() / std::ptrdiff_t{sizeof(Pixel)});
    for (const auto& band : interval.bands) {
      for (std::size_t chunk = 0; chunk < band.points.chunks(); ++chunk) {
        const Pixel* const brightness = band.brightness.data() + chunk * MovingPoints::chunk_size;
        j = begin;
        for (auto& frame : frames) {
          Pixel* const pixels = frame.row(0);
          const auto places = band.points.at(j++, stride, chunk, places_);
          for (std::size_t i = 0; i < places.size(); ++i) pixels[places[i]] = brightness[i];
        }
      }
    }
  }

  /// Number of frames drawn together while a chunk of the moving pixels is in the cache.
  static constexpr int steps_at_once = 4;

  Image<Pixel> still_;  ///< the touched rows without the pixels that have left their start
  std::vector<Image<Pixel>> frames_;  ///< the previous one, and those drawn together
  std::vector<std::int32_t> places_;  ///< indices in a frame of the pixels of a chunk
};

template <class Pixel>
class SparseSimulator final : public Simulator {
 public:
  explicit SparseSimulator(const LumaFormat& format)
      : Simulator(format),
        last_(format.width, format.height),
        bands_(band_count(format.height)),
        touched_(format.height) {}

 private:
  void start(const LumaView& frame) override {
    last_.assign(frame.as<Pixel>());
    tracker_.push(grey_.of(frame), threads());
  }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                StepBuckets& events) override {
    const auto now = frame.as<Pixel>();
    const auto thresholds = Thresholds::of(settings, format().bits);
    find_changed(now, std::min(thresholds.positive, thresholds.negative));
    tracker_.push(grey_.of(frame), threads());
    follow_changed(now, steps.count());

    const int m = steps.count();
    events.reset(m, 1);
    const Interval<Pixel> interval{last_.view(), now, bands_, touched_};
    // Each thread draws consecutive steps, so that it uses all frames but its first twice.
    const int runs = std::min(threads().threads(), m);
    while (static_cast<int>(painters_.size()) < runs)
      painters_.emplace_back(format().width, format().height);
    threads().for_each(runs, [&](int run, int) {
      painters_[run].fire(interval, m * run / runs + 1, m * (run + 1) / runs, steps, thresholds,
                          events);
    });
    last_.assign(now);
  }

  /// Finds the pixels whose change exceeds `threshold`, in raster order.
  void find_changed(const ImageView<Pixel>& now, int threshold) {
    const int bands = band_count(now.height);
    changes_.reset(1, bands);
    fire_differences(last_.view(), now, 1, 0, {threshold, threshold}, threads(), changes_);
    first_.assign(1, 0);
    for (int band = 0; band < bands; ++band)
      first_.push_back(first_.back() + changes_.pixels(1, band).size());
    changed_.resize(first_.back());
    threads().for_each(bands, [this](int band, int) {
      Point* out = changed_.data() + first_[band];
      changes_.pixels(1, band).visit([&](std::span<const Event> changes) {
        for (const auto& change : changes) *out++ = {change.x, change.y()};
      });
    });
  }

  void follow_changed(const ImageView<Pixel>& now, int steps) {
    const auto tracks = tracker_.track(changed_, threads());
    threads().for_each(static_cast<int>(bands_.size()), [&](int i, int) {
      const auto index = static_cast<std::size_t>(i);
      auto& band = bands_[index];
      band.points.clear();
      band.brightness.clear();
      band.uncovered.resize(static_cast<std::size_t>(steps) + 1);
      for (auto& step : band.uncovered) step.clear();
      band.top = format().height;
      band.bottom = 0;
      for (std::size_t k = first_[index]; k < first_[index + 1]; ++k) {
        const auto point =
            moving_point(changed_[k], tracks[k], steps, format().width, format().height);
        if (!point) continue;
        const auto [x, y] = point->start;
        band.points.push_back(*point);
        band.brightness.push_back(last_.at(x, y));
        band.uncovered[static_cast<std::size_t>(departure_of(*point, steps))].push_back(
            {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y), now.row(y)[x]});
        const int end = point->at(steps).y;
        band.top = std::min({band.top, y, end});
        band.bottom = std::max({band.bottom, y + 1, end + 1});
      }
    });
    std::fill(touched_.begin(), touched_.end(), 0);
    for (const auto& band : bands_)
      for (int y = band.top; y < band.bottom; ++y) touched_[y] = 1;
  }

  Image<Pixel> last_;
  PointTracker tracker_{2};
  Grey8 grey_;
  StepBuckets changes_;
  std::vector<Point> changed_;
  std::vector<std::size_t> first_;  ///< index of the first changed pixel of each band, and the end
  std::vector<MovingBand<Pixel>> bands_;
  std::vector<char> touched_;
  std::vector<Painter<Pixel>> painters_;  ///< one per thread
};

}  // namespace

std::unique_ptr<Simulator> make_sparse_simulator(const LumaFormat& format) {
  if (format.bits > 8) return std::make_unique<SparseSimulator<std::uint16_t>>(format);
  return std::make_unique<SparseSimulator<std::uint8_t>>(format);
}

}  // namespace eventcamera
