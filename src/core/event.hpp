// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace eventcamera {

static_assert(std::endian::native == std::endian::little,
              "events are handed on as they lie in memory, and XYTP is little-endian");

/// Time on a recording's own clock, past every wrap of its format.
using Microseconds = std::int64_t;
using Nanoseconds = std::int64_t;

/// The longest interval whose microseconds fit into an event's 32 bits (71 minutes).
inline constexpr Nanoseconds max_interval = Nanoseconds{0xffffffff} * 1000;

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

/// The time of an event in microseconds. One at the start of its interval (start, end], by
/// rounding, is moved inside.
constexpr Microseconds time_of(const Event& event, Microseconds start) {
  return start + (event.t == 0 ? 1 : event.t);
}

/// Of sorted events whose times count from `start`, those that are not later than `end`.
inline std::span<const Event> events_until(std::span<const Event> events, Microseconds start,
                                           Microseconds end) {
  const auto first_after =
      std::ranges::find_if(events, [&](const Event& event) { return time_of(event, start) > end; });
  return events.first(static_cast<std::size_t>(first_after - events.begin()));
}

/// The order of simulated events: by time, and within a time in raster order.
inline bool is_before(const Event& a, const Event& b) {
  const auto place = [](const Event& event) {
    return static_cast<std::uint32_t>(event.y()) << 16 | event.x;
  };
  return a.t != b.t ? a.t < b.t : place(a) < place(b);
}

/// Sorts events into that order that are sorted by time alone, and mostly in order already.
inline void sort_within_times(std::vector<Event>& events) {
  for (auto run = events.begin(); run != events.end();) {
    const auto end =
        std::find_if(run, events.end(), [&](const Event& event) { return event.t != run->t; });
    if (!std::is_sorted(run, end, is_before)) std::sort(run, end, is_before);
    run = end;
  }
}

/// An event with its 64-bit time.
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
