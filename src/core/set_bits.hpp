// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

namespace eventcamera {

/// Positions of the set bits of each byte, in order; zeros follow.
struct SetBits {
  constexpr SetBits() {
    for (std::size_t byte = 0; byte < 256; ++byte) {
      std::size_t count = 0;
      for (std::uint8_t bit = 0; bit < 8; ++bit)
        if ((byte >> bit & 1) != 0) of[byte][count++] = bit;
    }
  }

  std::uint8_t of[256][8] = {};
};
inline constexpr SetBits set_bits;

}  // namespace eventcamera
