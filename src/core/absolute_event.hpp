// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/event.hpp"

namespace eventcamera {

/// Microseconds since a recording's own zero of time, past every wrap of its format.
using Microseconds = std::int64_t;

/// One event of a recording, on its own: with its whole time.
struct AbsoluteEvent {
  Microseconds t;
  std::uint16_t x;    ///< column, from the left
  std::uint16_t y_p;  ///< row from the top in bits 0-14; bit 15 is the polarity, 1 = ON

  static constexpr AbsoluteEvent at(int x, int y, Microseconds t, Polarity polarity) {
    const auto event = Event::at(x, y, 0, polarity);
    return {t, event.x, event.y_p};
  }
  constexpr int y() const { return y_p & 0x7fff; }
  constexpr Polarity polarity() const { return (y_p & 0x8000) != 0 ? Polarity::on : Polarity::off; }

  friend constexpr bool operator==(const AbsoluteEvent&, const AbsoluteEvent&) = default;
};

/// An edge on a camera's trigger input.
struct Trigger {
  Microseconds t;
  std::uint16_t id;  ///< of the input
  bool rising;

  friend constexpr bool operator==(const Trigger&, const Trigger&) = default;
};

}  // namespace eventcamera
