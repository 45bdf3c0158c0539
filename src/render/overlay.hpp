// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "src/core/event.hpp"
#include "src/core/event_validator.hpp"
#include "src/core/image.hpp"
#include "src/core/sensor_size.hpp"
#include "src/render/event_window.hpp"
#include "src/render/palette.hpp"

namespace eventcamera {

/// Draws the events of a time window over video frames, scaled to their size. Events and frames
/// must be passed in time order.
class Overlay {
 public:
  Overlay(SensorSize sensor, SensorSize picture);

  /// Like Renderer::add().
  InvalidEvents add(std::span<const Event> events, Microseconds start,
                    Microseconds max_t = std::numeric_limits<Microseconds>::max());

  /// Draws the events of (start, end], and of [start, end] the first time, over a frame; `opacity`
  /// from 0 to 1, `stride` in bytes.
  void draw(Microseconds start, Microseconds end, const Palette& palette, double opacity,
            const PixelLayout& layout, std::byte* picture, std::ptrdiff_t stride);

 private:
  void mark(int x, int y, std::uint8_t kind);

  SensorSize sensor_;
  SensorSize picture_;
  EventValidator validator_;
  EventWindow window_;
  bool has_drawn_ = false;
  Image<std::uint8_t> kinds_;  ///< per pixel of the frame; all 0 between calls
};

}  // namespace eventcamera
