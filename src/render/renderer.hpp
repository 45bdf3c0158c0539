// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
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
  accumulate,    ///< which polarities fired within a window
  decay,         ///< the sum of ON minus OFF, fading exponentially
  time_surface,  ///< how recent the last event is, by its polarity
  count,         ///< ON minus OFF within a window
};

/// A change of any but the palette starts a new picture.
struct RenderSettings {
  RenderMode mode = RenderMode::accumulate;
  PaletteName palette = PaletteName::dark;
  WindowLimits limits{};                 ///< of accumulate and count
  Microseconds time_constant = 100'000;  ///< of decay, and how long time_surface looks back
  float full_scale = 2;                  ///< events that decay and count show in full colour

  friend bool operator==(const RenderSettings&, const RenderSettings&) = default;
};

/// Draws the events up to a moment as a picture. Events and pictures come in the order of time.
class Renderer {
 public:
  /// Up to 65535 x 32768 pixels. Throws std::bad_alloc, as do configure() and add().
  Renderer(int width, int height, const RenderSettings& settings);

  void configure(const RenderSettings& settings);

  /// Forgets all events and their times.
  void reset();

  /// Takes sorted events that count their times from `start`. A late event is moved to the time of
  /// the last one, or to after the last picture; one outside the picture is skipped. Returns how
  /// many were skipped.
  std::size_t add(std::span<const Event> events, Microseconds start);

  /// Draws the picture at `end`. The window of accumulate and count is (start, end]. `stride` in
  /// bytes.
  void draw(Microseconds start, Microseconds end, const PixelLayout& layout, std::byte* out,
            std::ptrdiff_t stride);

  int width() const { return width_; }
  int height() const { return height_; }

 private:
  using Memory = std::variant<EventWindow, DecayingSums, TimeSurface>;

  static Memory make_memory(int width, int height, const RenderSettings& settings);
  void shade_row(int y, Microseconds time);

  int width_;
  int height_;
  RenderSettings settings_;
  Memory memory_;
  EventValidator validator_;
  std::vector<std::uint8_t> row_;  ///< shades, or kinds, of the pixels of a row
};

}  // namespace eventcamera
