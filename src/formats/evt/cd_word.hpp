// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <bit>
#include <cstdint>
#include <span>

#include "src/core/event.hpp"

namespace eventcamera {

/// What EVT2 and EVT4 words, and the upper half of EVT2.1 words, have in common.
struct CdWord {
  std::uint32_t bits;

  /// `time` is the low bits of a time; what is above them is cut off.
  static constexpr CdWord at(std::uint32_t type, std::uint64_t time, std::uint32_t x,
                             std::uint32_t y) {
    return {type << 28 | (static_cast<std::uint32_t>(time) & 63) << 22 | (x & 0x7ff) << 11 |
            (y & 0x7ff)};
  }
  /// `count` is of 64 microseconds.
  static constexpr CdWord time_high(std::uint32_t type, std::uint64_t count) {
    return {type << 28 | (static_cast<std::uint32_t>(count) & 0x0fffffff)};
  }

  constexpr std::uint32_t type() const { return bits >> 28; }
  constexpr std::uint32_t count() const { return bits & 0x0fffffff; }
  constexpr std::uint32_t time_low() const { return bits >> 22 & 63; }
  constexpr std::uint32_t x() const { return bits >> 11 & 0x7ff; }
  constexpr std::uint32_t y() const { return bits & 0x7ff; }

  /// `on` is 0 or 1; `time` is that of the last TIME_HIGH.
  constexpr AbsoluteEvent event(std::uint64_t time, std::uint32_t on) const {
    return {static_cast<Microseconds>(time + time_low()), static_cast<std::uint16_t>(x()),
            static_cast<std::uint16_t>(y() | on << 15)};
  }

  /// The same of a word that is a trigger.
  constexpr Trigger trigger(std::uint64_t time) const {
    return {static_cast<Microseconds>(time + time_low()),
            static_cast<std::uint16_t>(bits >> 8 & 31), (bits & 1) != 0};
  }
};

/// Writes an event for each set bit of `mask`: bit i is i pixels to the right of `first`. Returns
/// the end of the events.
inline AbsoluteEvent* expand(std::uint32_t mask, const AbsoluteEvent& first,
                             AbsoluteEvent* events) {
  for (; mask != 0; mask &= mask - 1)
    *events++ = {first.t, static_cast<std::uint16_t>(first.x + std::countr_zero(mask)), first.y_p};
  return events;
}

/// Events of one time, polarity and row, within 32 pixels from `base` on.
struct MaskedEvents {
  std::uint32_t base;
  std::uint32_t mask = 0;
  std::size_t count = 0;
};

/// The first of some events, as far as one mask holds them. A sensor's words begin at multiples of
/// 32, and hold what comes in the order of columns.
inline MaskedEvents first_masked(std::span<const AbsoluteEvent> events) {
  const auto& first = events.front();
  MaskedEvents masked{.base = first.x & ~31U};
  auto& count = masked.count;
  do {
    masked.mask |= std::uint32_t{1} << (events[count].x & 31);
    ++count;
  } while (count < events.size() && events[count].t == first.t && events[count].y_p == first.y_p &&
           events[count].x > events[count - 1].x && events[count].x - masked.base < 32);
  return masked;
}

}  // namespace eventcamera
