// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <bit>
#include <cstdint>

namespace eventcamera {

static_assert(std::endian::native == std::endian::little,
              "events are handed on as they lie in memory, and XYTP is little-endian");

enum class Polarity : std::uint8_t { off = 0, on = 1 };

/// One event, laid out as caps format XYTP has it.
struct Event {
  std::uint32_t t;    ///< microseconds after the start of the interval, rounded down
  std::uint16_t x;    ///< column, from the left
  std::uint16_t y_p;  ///< row from the top in bits 0-14; bit 15 is the polarity, 1 = ON

  static constexpr Event at(int x, int y, std::uint32_t t, Polarity polarity) {
    return {t, static_cast<std::uint16_t>(x),
            static_cast<std::uint16_t>(y | (polarity == Polarity::on ? 0x8000 : 0))};
  }
  constexpr int y() const { return y_p & 0x7fff; }
  constexpr Polarity polarity() const { return (y_p & 0x8000) != 0 ? Polarity::on : Polarity::off; }

  friend constexpr bool operator==(const Event&, const Event&) = default;
};
static_assert(sizeof(Event) == 8);

}  // namespace eventcamera
