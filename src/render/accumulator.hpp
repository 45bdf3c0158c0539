// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "src/event/event.hpp"
#include "src/picture/plane.hpp"
#include "src/render/palette.hpp"

namespace eventcamera {

/// Where a picture's pixels go: one byte of grey, or bytes of red, green, blue and, in some
/// layouts, one that is filled with 255.
struct PixelLayout {
  int bytes = 1;                     ///< of a pixel: 1 = grey, else 3 or 4
  int red = 0, green = 1, blue = 2;  ///< their places in it; unused for grey
};

/// Collects events in a picture that shows, for each pixel, which polarities fired.
class Accumulator {
 public:
  Accumulator(int width, int height) : fired_(width, height) {}

  /// Events outside the picture must not occur.
  void add(std::span<const Event> events);

  /// Draws what was collected and begins anew. `stride` in bytes.
  void draw(const Palette& palette, const PixelLayout& layout, std::byte* out,
            std::ptrdiff_t stride);

 private:
  Plane<std::uint8_t> fired_;  // bit 0: OFF, bit 1: ON
};

}  // namespace eventcamera
