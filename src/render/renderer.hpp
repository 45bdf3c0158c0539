// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

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
#include "src/render/decaying_sums.hpp"
#include "src/render/event_window.hpp"
#include "src/render/palette.hpp"

namespace eventcamera {

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

  /// Passes a value per pixel of a row to `take`: from 1 for an event at `time` down to 0 at
  /// `max_age`; negative if the last event is OFF. `time` must not be before any event.
  template <class Take>
  void read_row(int y, Microseconds time, const Take& take) const {
    const auto* row = last_.row(y);
    const float scale = 1 / static_cast<float>(max_age_);
    for (int x = 0; x < last_.width(); ++x) {
      const Microseconds left = max_age_ - (time - row[x].time);
      take(x, left > 0 ? row[x].sign * static_cast<float>(left) * scale : 0);
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
/// A picture has a pixel for each sensor pixel, or, if these are more than max_pixels, as a hostile
/// file may state, for each 2x2, 3x3, ... sensor pixels.
class Renderer {
 public:
  static constexpr int max_pixels = 1 << 23;  ///< of a picture; 4K video fits

  /// For a sensor of at most max_side x max_side pixels. Throws std::bad_alloc, as do configure()
  /// and add().
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

  /// Size of the pictures.
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
