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
#include "src/render/decaying_sums.hpp"
#include "src/render/event_window.hpp"
#include "src/render/palette.hpp"
#include "src/render/time_surface.hpp"

namespace eventcamera {

enum class RenderMode {
  accumulate,    ///< polarities that fired within a window
  decay,         ///< exponentially decaying sum of ON minus OFF
  time_surface,  ///< age and polarity of the last event
  count,         ///< ON minus OFF within a window
};

/// Changing any setting except the palette forgets all events.
struct RenderSettings {
  RenderMode mode = RenderMode::accumulate;
  PaletteName palette = PaletteName::dark;
  WindowLimits limits{};                 ///< for accumulate and count
  Microseconds time_constant = 100'000;  ///< of decay; maximum age for time_surface
  float full_scale = 2;  ///< number of events shown in full colour by decay and count

  friend bool operator==(const RenderSettings&, const RenderSettings&) = default;
};

/// Draws pictures of the events up to given times. Events and pictures must be in time order.
///
/// A picture has a pixel for each of the sensor's. If these are more than max_pixels, as a hostile
/// file may state, it has one for 2x2, 3x3, ... of them.
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
  /// `max_t`, are skipped. Returns what was skipped.
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
  using Memory = std::variant<EventWindow, DecayingSums, TimeSurface>;

  static Memory make_memory(int width, int height, const RenderSettings& settings);
  void shade_row(int y, Microseconds time);

  int reduction_;  ///< pixels of the sensor a side of a pixel of the picture
  int width_;
  int height_;
  RenderSettings settings_;
  Memory memory_;
  EventValidator validator_;
  bool has_drawn_ = false;
  std::vector<std::uint8_t> row_;  ///< shades or kinds of the pixels of a row
};

}  // namespace eventcamera
