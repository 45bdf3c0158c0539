// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

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

enum class PaletteName { light, dark, grey, red_blue };

const Palette& palette(PaletteName name);

}  // namespace eventcamera
