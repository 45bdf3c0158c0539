// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace eventcamera {

struct Colour {
  std::uint8_t red;
  std::uint8_t green;
  std::uint8_t blue;
};

/// Colours of accumulated events, which also differ in brightness, for grey output.
struct Palette {
  Colour none;  ///< no event
  Colour off;   ///< OFF only
  Colour on;    ///< ON only
  Colour both;  ///< ON and OFF
};

enum class PaletteName { light, dark, grey, red_blue, viridis, magma };

const Palette& palette(PaletteName name);

/// Colours of values from -1 to 1, indexed by shade().
using Shades = std::array<Colour, 256>;

/// Index of a value, clamped to [-1, 1].
constexpr std::uint8_t shade(float value) {
  const float scaled = 127 * std::clamp(value, -1.0F, 1.0F);
  return static_cast<std::uint8_t>(128.5F + scaled);
}

/// Perceptually uniform shades from the colour of `none` to those of `off` for negative and `on`
/// for positive values. Viridis and magma show only the magnitude.
const Shades& shades(PaletteName name);

/// Layout of output pixels: one byte of grey, or bytes of red, green, blue and, in some layouts,
/// one set to 255.
struct PixelLayout {
  int bytes = 1;                     ///< per pixel: 1 = grey, else 3 or 4
  int red = 0, green = 1, blue = 2;  ///< byte offsets; unused for grey
};

/// Bytes of a pixel; only the first `bytes` of the layout are used.
using PixelBytes = std::array<std::uint8_t, 4>;

/// BT.601 luma.
constexpr std::uint8_t luma(const Colour& colour) {
  return static_cast<std::uint8_t>(
      (299 * colour.red + 587 * colour.green + 114 * colour.blue + 500) / 1000);
}

constexpr PixelBytes pixel(const Colour& colour, const PixelLayout& layout) {
  if (layout.bytes == 1) return {luma(colour)};
  PixelBytes bytes{255, 255, 255, 255};
  bytes[static_cast<std::size_t>(layout.red)] = colour.red;
  bytes[static_cast<std::size_t>(layout.green)] = colour.green;
  bytes[static_cast<std::size_t>(layout.blue)] = colour.blue;
  return bytes;
}

/// Pixels by kind, the bits of the polarities that fired: 1 OFF, 2 ON.
constexpr std::array<PixelBytes, 4> pixels_by_kind(const Palette& palette,
                                                   const PixelLayout& layout) {
  return {pixel(palette.none, layout), pixel(palette.off, layout), pixel(palette.on, layout),
          pixel(palette.both, layout)};
}

}  // namespace eventcamera
