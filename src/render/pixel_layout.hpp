// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "src/render/palette.hpp"

namespace eventcamera {

/// Where a picture's pixels go: one byte of grey, or bytes of red, green, blue and, in some
/// layouts, one that is filled with 255.
struct PixelLayout {
  int bytes = 1;                     ///< of a pixel: 1 = grey, else 3 or 4
  int red = 0, green = 1, blue = 2;  ///< their places in it; unused for grey
};

/// Brightness as BT.601 weighs it.
constexpr std::uint8_t luma(const Colour& colour) {
  return static_cast<std::uint8_t>(
      (299 * colour.red + 587 * colour.green + 114 * colour.blue + 500) / 1000);
}

/// A pixel of this colour; as many of the bytes as the layout has.
constexpr std::array<std::uint8_t, 4> pixel(const Colour& colour, const PixelLayout& layout) {
  if (layout.bytes == 1) return {luma(colour)};
  std::array<std::uint8_t, 4> bytes{255, 255, 255, 255};
  bytes[static_cast<std::size_t>(layout.red)] = colour.red;
  bytes[static_cast<std::size_t>(layout.green)] = colour.green;
  bytes[static_cast<std::size_t>(layout.blue)] = colour.blue;
  return bytes;
}

}  // namespace eventcamera
