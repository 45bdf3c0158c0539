// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace eventcamera {

struct Colour {
  std::uint8_t red;
  std::uint8_t green;
  std::uint8_t blue;
};

/// The colours of accumulated events. In each palette the four differ in brightness too, so that
/// they are told apart in a grey picture.
struct Palette {
  Colour none;  ///< no event
  Colour off;   ///< OFF only
  Colour on;    ///< ON only
  Colour both;  ///< ON and OFF
};

enum class PaletteName { light, dark, grey, red_blue, viridis, magma };

const Palette& palette(PaletteName name);

/// The colours of values from -1 to 1, by shade().
using Shades = std::array<Colour, 256>;

/// The shade of a value, which is saturated.
constexpr std::uint8_t shade(float value) {
  const float scaled = 127 * std::clamp(value, -1.0F, 1.0F);
  return static_cast<std::uint8_t>(128.5F + scaled);
}

/// From the colour of no event to that of OFF below 0 and to that of ON above, in even steps to the
/// eye. The palettes that are one scale show the magnitude alone.
const Shades& shades(PaletteName name);

}  // namespace eventcamera
