// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/simulators.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "src/simulate/difference.hpp"
#include "src/simulate/moving_points.hpp"

namespace eventcamera {
namespace {

/// Pixels of a difference frame that exceeded the threshold of one polarity, in raster order.
struct KeptPixels {
  std::vector<Point> places;
  std::vector<int> differences;    ///< I(i) - I(i-1) at each pixel
  std::vector<std::size_t> first;  ///< index of the first one of each band, and the end
};

/// One polarity of the last two difference frames.
struct PolarityFrames {
  PolarityFrames(int width, int height)
      : image(width, height, 1), is_black(static_cast<std::size_t>(height), 1) {
    now.first.assign(static_cast<std::size_t>(band_count(height)) + 1, 0);
  }

  KeptPixels last;
  KeptPixels now;
  Image<std::uint8_t> image;           ///< `now` as an 8-bit image, 0 for pixels not kept
  std::vector<std::uint8_t> is_black;  ///< 1 for each row of the image without a kept pixel
  PointTracker tracker{1};

  /// Makes `now` the last difference frame, and starts a new one with empty bands.
  void begin_next() {
    std::swap(last, now);
    now.first.assign(1, 0);
  }

  void add_band(std::size_t size) { now.first.push_back(now.first.back() + size); }

  /// Resizes the lists to the pixels of all bands.
  void resize() {
    now.places.resize(now.first.back());
    now.differences.resize(now.first.back());
  }

  /// Removes the pixels of the last difference frame from a band of the image.
  void clear(std::size_t band) {
    for (std::size_t i = last.first[band]; i < last.first[band + 1]; ++i) {
      const auto& place = last.places[i];
      image.at(place.x, place.y) = 0;
      is_black[place.y] = 1;
    }
  }

  void keep(std::size_t i, const Point& place, int difference, int shift) {
    now.places[i] = place;
    now.differences[i] = difference;
    image.at(place.x, place.y) =
        static_cast<std::uint8_t>(std::max(1, std::abs(difference) >> shift));
    is_black[place.y] = 0;
  }

  /// Prepares to track to this difference frame and, in the next interval, from it.
  void push(ThreadPool& threads) {
    if (!now.places.empty()) tracker.push(image.view(), threads, is_black);
  }

  /// True if a pixel of this difference frame is kept within one pixel of `place`.
  bool keeps_near(const Point& place) const {
    int near = 0;
    for (int y = place.y - 1; y <= place.y + 1; ++y)
      for (int x = place.x - 1; x <= place.x + 1; ++x) near |= image.at(x, y);
    return near != 0;
  }
};

/// Kept pixels of a band of the last difference frame, moving towards this one. On its own cache
/// lines, because threads fill neighbouring bands concurrently.
template <class Strength>
struct alignas(64) MovingBand {
  MovingPoints points;
  std::vector<Strength> strengths;
};

/// Interpolated difference frame: the strength of each pixel, 0 if it does not fire.
template <class Strength>
class DifferenceFrame {
 public:
  DifferenceFrame(int width, int height)
      : height_(height),
        words_((width + 63) / 64),
        strengths_(static_cast<std::size_t>(64 * words_) * static_cast<std::size_t>(height)),
        touched_(static_cast<std::size_t>(words_) * static_cast<std::size_t>(height)) {}

  /// Adds the pixels of a band at their positions after j steps; the strongest on a pixel wins.
  void add(const MovingBand<Strength>& band, int j) {
    auto* const strengths = strengths_.data();
    auto* const touched = touched_.data();
    const Strength* strength = band.strengths.data();
    for (std::size_t chunk = 0; chunk < band.points.chunks(); ++chunk) {
      for (const auto place : band.points.at(j, 64 * words_, chunk, places_)) {
        auto& strongest = strengths[place];
        strongest = std::max(strongest, *strength++);
        touched[place / 64] = 1;
      }
    }
  }

  /// Emits the pixels that fire and clears them.
  void fire(int step, std::uint32_t t, StepBuckets& events) {
    for (int band = 0; band < events.bands(); ++band) {
      const BandRows rows(band, height_);
      auto* touched = touched_.data() + std::ptrdiff_t{rows.first} * words_;
      const int words = (rows.last - rows.first) * words_;
      if (std::memchr(touched, 1, static_cast<std::size_t>(words)) == nullptr) continue;
      auto& out = events.pixels(step, band);
      out.begin(t);
      for (int y = rows.first; y < rows.last; ++y, touched += words_)
        fire_strengths(strengths_.data() + std::ptrdiff_t{64} * words_ * y, touched, words_, y,
                       out);
    }
  }

 private:
  int height_;
  int words_;  ///< per row, of 64 pixels
  std::vector<Strength> strengths_;
  std::vector<std::uint8_t> touched_;  ///< 1 for each word with a pixel that fires
  std::vector<std::int32_t> places_;
};

template <class Pixel>
class DiffSimulator final : public Simulator {
  /// Twice the magnitude of a difference, plus 1 for ON, which wins over an equal OFF.
  using Strength = std::conditional_t<sizeof(Pixel) == 1, std::uint16_t, std::uint32_t>;

  static Strength strength_of(int difference) {
    return static_cast<Strength>(2 * std::abs(difference) + (difference > 0 ? 1 : 0));
  }

 public:
  explicit DiffSimulator(const LumaFormat& format)
      : Simulator(format),
        last_(format.width, format.height),
        on_(format.width, format.height),
        off_(format.width, format.height),
        moving_(band_count(format.height)) {}

 private:
  void start(const LumaView& frame) override {
    last_.assign(frame.as<Pixel>());
    has_difference_ = false;
  }

  void simulate(const LumaView& frame, const StepTimes& steps, const Settings& settings,
                StepBuckets& events) override {
    const auto now = frame.as<Pixel>();
    const auto thresholds = Thresholds::of(settings, format().bits);
    const int m = steps.count();
    events.reset(m, band_count(now.height));
    fire_differences(last_.view(), now, m, steps.microseconds(m), thresholds, threads(), events);
    keep_difference(now, m, events);
    on_.push(threads());
    off_.push(threads());
    if (has_difference_ && m > 1) {
      for (auto& band : moving_) {
        band.points.clear();
        band.strengths.clear();
      }
      follow(on_, m);
      follow(off_, m);
      fire_between(steps, events);
    }
    has_difference_ = true;
  }

  /// Keeps D(i) = I(i) - I(i-1) at the pixels that fired, by polarity, and stores I(i).
  void keep_difference(const ImageView<Pixel>& now, int last_step, StepBuckets& events) {
    on_.begin_next();
    off_.begin_next();
    const int bands = band_count(now.height);
    for (int band = 0; band < bands; ++band) {
      const auto& fired = events.pixels(last_step, band);
      const auto on = fired.on_size();
      on_.add_band(on);
      off_.add_band(fired.size() - on);
    }
    on_.resize();
    off_.resize();
    const int shift = format().bits - 8;
    threads().for_each(bands, [&](int i, int) {
      const auto band = static_cast<std::size_t>(i);
      on_.clear(band);
      off_.clear(band);
      auto on = on_.now.first[band];
      auto off = off_.now.first[band];
      events.pixels(last_step, i).visit([&](std::span<const Event> fired) {
        for (const auto& event : fired) {
          const Point place{event.x, event.y()};
          const int difference = now.row(place.y)[place.x] - last_.at(place.x, place.y);
          if (event.polarity() == Polarity::on)
            on_.keep(on++, place, difference, shift);
          else
            off_.keep(off++, place, difference, shift);
        }
      });
      const BandRows rows(i, now.height);
      for (int y = rows.first; y < rows.last; ++y) last_.assign_row(y, now.row(y));
    });
  }

  /// Tracks the kept pixels of the last difference frame into this one.
  void follow(PolarityFrames& polarity, int steps) {
    const auto& last = polarity.last;
    if (last.places.empty() || polarity.now.places.empty())
      return;  // no track ends near a kept pixel
    const auto tracks = polarity.tracker.track(last.places, threads());
    threads().for_each(static_cast<int>(moving_.size()), [&](int i, int) {
      const auto index = static_cast<std::size_t>(i);
      auto& band = moving_[index];
      for (std::size_t k = last.first[index]; k < last.first[index + 1]; ++k) {
        const auto point =
            moving_point(last.places[k], tracks[k], steps, format().width, format().height);
        if (!point || !polarity.keeps_near(point->at(steps))) continue;
        band.points.push_back(*point);
        band.strengths.push_back(strength_of(last.differences[k]));
      }
    });
  }

  void fire_between(const StepTimes& steps, StepBuckets& events) {
    while (static_cast<int>(frames_.size()) < threads().threads())
      frames_.emplace_back(format().width, format().height);
    threads().for_each(steps.count() - 1, [&](int i, int thread) {
      const int j = i + 1;
      auto& frame = frames_[thread];
      for (const auto& band : moving_) frame.add(band, j);
      frame.fire(j, steps.microseconds(j), events);
    });
  }

  Image<Pixel> last_;
  bool has_difference_ = false;
  PolarityFrames on_;
  PolarityFrames off_;
  std::vector<MovingBand<Strength>> moving_;
  std::vector<DifferenceFrame<Strength>> frames_;  ///< one per thread
};

}  // namespace

std::unique_ptr<Simulator> make_diff_simulator(const LumaFormat& format) {
  if (format.bits > 8) return std::make_unique<DiffSimulator<std::uint16_t>>(format);
  return std::make_unique<DiffSimulator<std::uint8_t>>(format);
}

}  // namespace eventcamera
