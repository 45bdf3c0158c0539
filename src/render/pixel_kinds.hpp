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

/// What a pixel is made of where nothing fired, OFF, ON, or both.
struct PixelKinds {
  PixelKinds(const Palette& palette, const PixelLayout& layout) {
    std::size_t kind = 0;
    for (const auto& colour : {palette.none, palette.off, palette.on, palette.both}) {
      if (layout.bytes == 1) {
        bytes[0][kind] = luma(colour);
      } else {
        for (auto& byte : bytes) byte[kind] = 255;
        bytes[static_cast<std::size_t>(layout.red)][kind] = colour.red;
        bytes[static_cast<std::size_t>(layout.green)][kind] = colour.green;
        bytes[static_cast<std::size_t>(layout.blue)][kind] = colour.blue;
      }
      ++kind;
    }
  }

  /// Byte by byte of a pixel, what it is for each kind. As long as a table that SIMD code shuffles.
  alignas(16) std::array<std::array<std::uint8_t, 16>, 4> bytes{};

 private:
  /// Brightness as BT.601 weighs it.
  static std::uint8_t luma(const Colour& colour) {
    return static_cast<std::uint8_t>(
        (299 * colour.red + 587 * colour.green + 114 * colour.blue + 500) / 1000);
  }
};

}  // namespace eventcamera
