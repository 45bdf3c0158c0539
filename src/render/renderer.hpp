// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <variant>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/event_validator.hpp"
#include "src/core/image.hpp"
#include "src/reconstruct/reconstruction.hpp"
#include "src/render/event_window.hpp"
#include "src/render/palette.hpp"

namespace eventcamera {

/// Table of the exponential decay exp(-age / time constant).
class Exponential {
 public:
  /// `time_constant` must be above 0.
  explicit Exponential(Microseconds time_constant)
      : steps_per_microsecond_(steps_per_constant / static_cast<float>(time_constant)) {
    for (std::size_t i = 0; i < table_.size(); ++i)
      table_[i] = std::exp(-static_cast<float>(i) / steps_per_constant);
  }

  /// Exact at age 0, else accurate to 0.01 %; 0 below 1/3000.
  float after(Microseconds age) const {
    const float steps = static_cast<float>(age) * steps_per_microsecond_;
    if (!(steps < max_steps)) return 0;
    const auto step = static_cast<std::size_t>(steps);
    const float share = steps - static_cast<float>(step);
    return table_[step] + share * (table_[step + 1] - table_[step]);
  }

 private:
  static constexpr float steps_per_constant = 32;
  static constexpr float max_steps = 8 * steps_per_constant;

  float steps_per_microsecond_;
  std::array<float, static_cast<std::size_t>(max_steps) + 1> table_;
};

/// Exponentially decaying sum of ON minus OFF events per pixel.
class DecayingSums {
 public:
  /// Sums are clamped to [-`max`, `max`].
  DecayingSums(int width, int height, Microseconds time_constant, float max)
      : exponential_(time_constant), max_(max), sums_(width, height) {}

  /// Adds an event, which must lie inside the picture and not be earlier than the last one.
  void add(const AbsoluteEvent& event) {
    auto& sum = sums_.at(event.x, event.y());
    const float step = event.polarity() == Polarity::on ? 1.0F : -1.0F;
    sum.value = std::clamp(sum.value * exponential_.after(event.t - sum.time) + step, -max_, max_);
    sum.time = event.t;
  }

  /// Passes the sums of a row to `use`, as fractions of the maximum. `time` must not be before any
  /// event.
  template <class Use>
  void read_row(int y, Microseconds time, const Use& use) const {
    const auto* row = sums_.row(y);
    for (int x = 0; x < sums_.width(); ++x)
      use(x, row[x].value == 0 ? 0 : row[x].value * exponential_.after(time - row[x].time) / max_);
  }

 private:
  struct Sum {
    float value = 0;
    Microseconds time = 0;  ///< time of the last event
  };

  Exponential exponential_;
  float max_;
  Image<Sum> sums_;
};

/// Age and polarity of the last event of each pixel.
class TimeSurface {
 public:
  /// Events older than `max_age` > 0 are ignored.
  TimeSurface(int width, int height, Microseconds max_age)
      : max_age_(max_age), last_(width, height) {}

  /// Adds an event, which must lie inside the picture and not be earlier than the last one.
  void add(const AbsoluteEvent& event) {
    last_.at(event.x, event.y()) = {event.t, event.polarity() == Polarity::on ? 1.0F : -1.0F};
  }

  /// Passes a value per pixel of a row to `use`: from 1 for an event at `time` down to 0 at
  /// `max_age`; negative if the last event is OFF. `time` must not be before any event.
  template <class Use>
  void read_row(int y, Microseconds time, const Use& use) const {
    const auto* row = last_.row(y);
    const float scale = 1 / static_cast<float>(max_age_);
    for (int x = 0; x < last_.width(); ++x) {
      const Microseconds left = max_age_ - (time - row[x].time);
      use(x, left > 0 ? row[x].sign * static_cast<float>(left) * scale : 0);
    }
  }

 private:
  struct Last {
    Microseconds time = 0;
    float sign = 0;  ///< 0 = no event
  };

  Microseconds max_age_;
  Image<Last> last_;
};

enum class RenderMode {
  accumulate,    ///< polarities that fired within a window
  decay,         ///< exponentially decaying sum of ON minus OFF
  time_surface,  ///< age and polarity of the last event
  count,         ///< ON minus OFF within a window
  reconstruct,   ///< brightness
};

/// Changing any setting except the palette forgets all events.
struct RenderSettings {
  RenderMode mode = RenderMode::accumulate;
  PaletteName palette = PaletteName::dark;
  WindowLimits limits{};                 ///< for accumulate and count
  Microseconds time_constant = 100'000;  ///< of decay; maximum age for time_surface
  float full_scale = 2;  ///< number of events shown in full colour by decay and count
  Reconstruction::Settings reconstruction{};

  friend bool operator==(const RenderSettings&, const RenderSettings&) = default;
};

/// Draws pictures of the events up to given times. Events and pictures must be in time order.
///
/// A picture has a pixel for each sensor pixel or, if that exceeds max_pixels (a hostile file may
/// state any size), for each 2x2, 3x3, ... sensor pixels.
class Renderer {
 public:
  static constexpr int max_pixels = 1 << 23;  ///< of a picture; 4K video fits

  /// For a sensor of at most max_side x max_side pixels.
  Renderer(int width, int height, const RenderSettings& settings);

  void configure(const RenderSettings& settings);

  /// Forgets all events and their times.
  void reset();

  /// Adds sorted events whose times are relative to `start`. An event that is not later than the
  /// last picture is drawn in the next one; events outside the sensor, and those later than
  /// `max_t`, are skipped. Returns their numbers.
  InvalidEvents add(std::span<const Event> events, Microseconds start,
                    Microseconds max_t = std::numeric_limits<Microseconds>::max());

  /// Draws the picture at `end`. The window for accumulate and count is (start, end], and [start,
  /// end] for the first picture. `stride` in bytes.
  void draw(Microseconds start, Microseconds end, const PixelLayout& layout, std::byte* out,
            std::ptrdiff_t stride);

  int width() const { return width_; }
  int height() const { return height_; }

 private:
  using Memory = std::variant<EventWindow, DecayingSums, TimeSurface, Reconstruction>;

  static Memory make_memory(int width, int height, const RenderSettings& settings);
  void shade_row(int y, Microseconds time);

  int reduction_;  ///< sensor pixels along a side of a picture's pixel
  int width_;
  int height_;
  RenderSettings settings_;
  Memory memory_;
  EventValidator validator_;
  bool has_drawn_ = false;
  std::vector<std::uint8_t> row_;  ///< shades or kinds of the pixels of a row
};

}  // namespace eventcamera
