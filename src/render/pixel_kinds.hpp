// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "src/render/palette.hpp"
#include "src/render/pixel_layout.hpp"

namespace eventcamera {

/// What a pixel is made of where nothing fired, OFF, ON, or both.
struct PixelKinds {
  PixelKinds(const Palette& palette, const PixelLayout& layout) {
    std::size_t kind = 0;
    for (const auto& colour : {palette.none, palette.off, palette.on, palette.both}) {
      const auto drawn = pixel(colour, layout);
      for (std::size_t i = 0; i < drawn.size(); ++i) bytes[i][kind] = drawn[i];
      ++kind;
    }
  }

  /// Byte by byte of a pixel, what it is for each kind. As long as a table that SIMD code shuffles.
  alignas(16) std::array<std::array<std::uint8_t, 16>, 4> bytes{};
};

}  // namespace eventcamera
