// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/diff.hpp"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <utility>
#include <vector>

#include "src/simulate/difference.hpp"
#include "src/simulate/motion.hpp"

namespace eventcamera {
namespace {

/// Pixels of a difference frame that exceeded the threshold of one polarity, in raster order.
struct Kept {
  std::vector<Point> places;
  std::vector<int> differences;  ///< I(i) - I(i-1) at each pixel

  void clear() {
    places.clear();
    differences.clear();
  }
};

/// A kept pixel of the last difference frame, moving towards this one.
struct MovingDifference {
  MovingPoint point;
  int difference;
};

/// One polarity of the last two difference frames.
struct Part {
  Part(int width, int height) : picture(width, height) {}

  Kept last;
  Kept now;
  Image<std::uint8_t> picture;  ///< `now` as an 8-bit image, 0 for pixels not kept
  PointTracker tracker;

  void begin_next() {
    for (const auto& place : now.places) picture.at(place.x, place.y) = 0;
    std::swap(last, now);
    now.clear();
  }

  void keep(const Point& place, int difference, int shift) {
    now.places.push_back(place);
    now.differences.push_back(difference);
    picture.at(place.x, place.y) =
        static_cast<std::uint8_t>(std::max(1, std::abs(difference) >> shift));
  }

  /// True if a pixel of this difference frame is kept within one pixel of `place`.
  bool keeps_near(const Point& place) const {
    const int bottom = std::min(place.y + 1, picture.height() - 1);
    const int right = std::min(place.x + 1, picture.width() - 1);
    for (int y = std::max(place.y - 1, 0); y <= bottom; ++y)
      for (int x = std::max(place.x - 1, 0); x <= right; ++x)
        if (picture.at(x, y) != 0) return true;
    return false;
  }
};

/// Pixels that fire in one interpolated difference frame.
class FiredDifferences {
 public:
  FiredDifferences(int width, int height)
      : strongest_(width, height),
        words_((width + 63) / 64),
        taken_(static_cast<std::size_t>(words_) * static_cast<std::size_t>(height)),
        top_(height) {}

  /// The largest difference on a pixel wins; ON wins over an equal OFF.
  void add(const Point& place, int difference) {
    int& strongest = strongest_.at(place.x, place.y);
    if (std::abs(difference) > std::abs(strongest) || difference == -strongest)
      strongest = difference == -strongest ? std::abs(difference) : difference;
    taken_[word(place)] |= std::uint64_t{1} << (place.x % 64);
    top_ = std::min(top_, place.y);
    bottom_ = std::max(bottom_, place.y + 1);
  }

  /// Emits the accumulated pixels in raster order and clears them.
  void fire(int step, std::uint32_t t, EventBuckets& events) {
    for (int y = top_; y < bottom_; ++y) {
      auto& out = events.pixels(step, y / rows_per_band);
      if (y == top_ || y % rows_per_band == 0) out.begin(t);
      for (int x = 0; x < strongest_.width(); x += 64) {
        auto& taken = taken_[word({x, y})];
        if (taken == 0) continue;
        const auto fired = std::exchange(taken, 0);
        std::uint64_t on = 0;
        for (auto bits = fired; bits != 0; bits &= bits - 1) {
          const int i = std::countr_zero(bits);
          if (std::exchange(strongest_.at(x + i, y), 0) > 0) on |= std::uint64_t{1} << i;
        }
        out.add(x, y, fired, on);
      }
    }
    top_ = strongest_.height();
    bottom_ = 0;
  }

 private:
  std::size_t word(const Point& place) const {
    return static_cast<std::size_t>(place.y) * static_cast<std::size_t>(words_) +
           static_cast<std::size_t>(place.x / 64);
  }

  Image<int> strongest_;
  int words_;                         ///< 64-pixel words per row
  std::vector<std::uint64_t> taken_;  ///< one bit per pixel that fires
  int top_;                           ///< rows [top_, bottom_) hold all of them
  int bottom_ = 0;
};

template <class Pixel>
class DiffSimulator final : public Simulator {
 public:
  explicit DiffSimulator(const LumaFormat& format)
      : Simulator(format),
        last_(format.width, format.height),
        on_(format.width, format.height),
        off_(format.width, format.height) {}

 private:
  void start(const LumaView& frame) override {
    last_.assign(frame.as<Pixel>());
    has_difference_ = false;
  }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                EventBuckets& events) override {
    const auto now = frame.as<Pixel>();
    const auto thresholds = Thresholds::of(settings, format().bits);
    const int m = steps.count();
    events.reset(m, band_count(now.height));
    fire_differences(last_.view(), now, m, steps.microseconds(m), thresholds, threads(), events);
    keep_difference(now, m, events);
    on_.tracker.push(on_.picture.view(), threads());
    off_.tracker.push(off_.picture.view(), threads());
    if (has_difference_ && m > 1) {
      moving_.clear();
      follow(on_, m);
      follow(off_, m);
      fire_between(steps, events);
    }
    has_difference_ = true;
    last_.assign(now);
  }

  /// Keeps D(i) = I(i) - I(i-1) at pixels that fired, separately for each polarity.
  void keep_difference(const ImageView<Pixel>& now, int last_step, EventBuckets& events) {
    on_.begin_next();
    off_.begin_next();
    const int shift = format().bits - 8;
    const auto keep = [&](std::span<const Event> fired) {
      for (const auto& event : fired) {
        const Point place{event.x, event.y()};
        const int difference = now.row(place.y)[place.x] - last_.at(place.x, place.y);
        (event.polarity() == Polarity::on ? on_ : off_).keep(place, difference, shift);
      }
    };
    for (int band = 0; band < band_count(now.height); ++band)
      events.pixels(last_step, band).visit(keep);
  }

  /// Tracks the kept pixels of the last difference frame into this one.
  void follow(Part& part, int steps) {
    const auto& places = part.last.places;
    const auto tracks = part.tracker.track(places, threads());
    for (std::size_t i = 0; i < places.size(); ++i) {
      const auto point = moving_point(places[i], tracks[i], steps, format().width, format().height);
      if (point && part.keeps_near(point->at(steps)))
        moving_.push_back({*point, part.last.differences[i]});
    }
  }

  void fire_between(const StepTimes& steps, EventBuckets& events) {
    while (static_cast<int>(fired_differences_.size()) < threads().threads())
      fired_differences_.emplace_back(format().width, format().height);
    threads().for_each(steps.count() - 1, [&](int i, int thread) {
      const int j = i + 1;
      auto& fired_differences = fired_differences_[static_cast<std::size_t>(thread)];
      for (const auto& moving : moving_)
        fired_differences.add(moving.point.at(j), moving.difference);
      fired_differences.fire(j, steps.microseconds(j), events);
    });
  }

  Image<Pixel> last_;
  bool has_difference_ = false;
  Part on_;
  Part off_;
  std::vector<MovingDifference> moving_;
  std::vector<FiredDifferences> fired_differences_;  // one per thread
};

}  // namespace

std::unique_ptr<Simulator> make_diff_simulator(const LumaFormat& format) {
  if (format.bits > 8) return std::make_unique<DiffSimulator<std::uint16_t>>(format);
  return std::make_unique<DiffSimulator<std::uint8_t>>(format);
}

}  // namespace eventcamera
