// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <bit>
#include <cstdint>
#include <vector>

#include "src/event/event.hpp"

namespace eventcamera {

/// Appends an event for each bit of `fired`: bit i is the pixel (x + i, y), and bit i of `on` tells
/// whether it is ON.
inline void append_fired(std::uint64_t fired, std::uint64_t on, int x, int y, std::uint32_t t,
                         std::vector<Event>& out) {
  const auto before = out.size();
  out.resize(before + static_cast<std::size_t>(std::popcount(fired)));
  for (Event* event = out.data() + before; fired != 0; fired &= fired - 1, ++event) {
    const int i = std::countr_zero(fired);
    *event = Event::at(x + i, y, t, static_cast<Polarity>(on >> i & 1));
  }
}

}  // namespace eventcamera
