// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/sparse.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>
#include <vector>

#include "src/picture/grey8.hpp"
#include "src/simulate/bands.hpp"
#include "src/simulate/difference.hpp"
#include "src/simulate/moving_point.hpp"

namespace eventcamera {
namespace {

template <class Pixel>
class SparseSimulator final : public Simulator {
 public:
  explicit SparseSimulator(const LumaFormat& format)
      : Simulator(format),
        last_(format.width, format.height),
        before_(format.width, format.height),
        between_(format.width, format.height) {}

 private:
  void start(const LumaView& frame) override {
    last_.assign(frame.as<Pixel>());
    tracker_.push(grey_.of(frame), threads().threads());
  }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                EventBuckets& events) override {
    const auto now = frame.as<Pixel>();
    const auto thresholds = Thresholds::of(settings, format().bits);
    find_changed(now, std::min(thresholds.positive, thresholds.negative));
    tracker_.push(grey_.of(frame), threads().threads());
    follow_changed(steps.count());

    const int bands = band_count(now.height);
    events.reset(steps.count(), bands);
    before_.assign(last_.view());
    for (int j = 1; j <= steps.count(); ++j) {
      auto after = now;
      if (j < steps.count()) {
        interpolate(now, j);
        after = between_.view();
      }
      threads().for_each(bands, [&](int band, int) {
        const BandRows rows(band, now.height);
        for (int y = rows.first; y < rows.last; ++y)
          fire_differences(before_.row(y), after.row(y), now.width, y, steps.microseconds(j),
                           thresholds, events.bucket(j, band));
      });
      std::swap(before_, between_);
    }
    last_.assign(now);
  }

  /// The pixels whose change exceeds `threshold`, in raster order.
  void find_changed(const PlaneView<Pixel>& now, int threshold) {
    changed_.clear();
    for (int y = 0; y < now.height; ++y)
      for (int x = 0; x < now.width; ++x)
        if (std::abs(now.row(y)[x] - last_.at(x, y)) > threshold) changed_.push_back({x, y});
  }

  /// Sets the changed pixels moving towards this frame.
  void follow_changed(int steps) {
    points_.clear();
    const auto tracks = tracker_.track(changed_, threads().threads());
    for (std::size_t i = 0; i < changed_.size(); ++i)
      if (const auto point =
              moving_point(changed_[i], tracks[i], steps, format().width, format().height))
        points_.push_back(*point);
  }

  /// The interpolated frame of step j, into between_.
  void interpolate(const PlaneView<Pixel>& now, int j) {
    between_.assign(last_.view());
    for (const auto& point : points_) {
      const auto [x, y] = point.start;
      const auto [to_x, to_y] = point.at(j);
      if (to_x != x || to_y != y) between_.at(x, y) = now.row(y)[x];
    }
    for (const auto& point : points_) {
      const auto [to_x, to_y] = point.at(j);
      between_.at(to_x, to_y) = last_.at(point.start.x, point.start.y);
    }
  }

  Plane<Pixel> last_;
  PointTracker tracker_;
  Grey8 grey_;
  std::vector<Point> changed_;
  std::vector<MovingPoint> points_;
  Plane<Pixel> before_;
  Plane<Pixel> between_;
};

}  // namespace

std::unique_ptr<Simulator> make_sparse_simulator(const LumaFormat& format) {
  if (format.bits > 8) return std::make_unique<SparseSimulator<std::uint16_t>>(format);
  return std::make_unique<SparseSimulator<std::uint8_t>>(format);
}

}  // namespace eventcamera
