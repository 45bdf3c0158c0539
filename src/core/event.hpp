// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <span>

namespace eventcamera {

static_assert(std::endian::native == std::endian::little,
              "events are sent in memory layout, and XYTP is little-endian");

/// Time on a recording's own clock, with all wraps of its format undone.
using Microseconds = std::int64_t;
using Nanoseconds = std::int64_t;

/// Longest interval whose microseconds fit into the 32 bits of an event (71 minutes).
inline constexpr Nanoseconds max_interval = Nanoseconds{0xffffffff} * 1000;

enum class Polarity : std::uint8_t { off = 0, on = 1 };

/// One event, in the layout of caps format XYTP.
struct Event {
  std::uint32_t t;    ///< microseconds after the start of the interval, at most its duration
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

/// Returns the leading events that are not later than `end`; their times are relative to `start`.
inline std::span<const Event> events_until(std::span<const Event> events, Microseconds start,
                                           Microseconds end) {
  const auto first_after =
      std::ranges::find_if(events, [&](const Event& event) { return start + event.t > end; });
  return events.first(first_after - events.begin());
}

/// Bits of a coordinate. Simulators carry the cause of an event in the other bits (label.hpp).
inline constexpr unsigned coordinate_bits = 0x3fff;

/// Order of simulated events: by time, then in raster order.
inline constexpr auto is_before = [](const Event& a, const Event& b) {
  const auto place = [](const Event& event) {
    return std::uint64_t{event.t} << 32 | (event.y_p & coordinate_bits) << 16 |
           (event.x & coordinate_bits);
  };
  return place(a) < place(b);
};

/// Sorts events with is_before(). Events of different spans of 2^span_bits microseconds must
/// already be in order.
inline void sort_within_spans(std::span<Event> events, int span_bits) {
  constexpr std::ptrdiff_t near = 32;  // moving an event this far is cheaper than sorting
  for (auto next = events.begin();;) {
    next = std::is_sorted_until(next, events.end(), is_before);
    if (next == events.end()) return;
    const auto nearest = next - std::min(near, next - events.begin());
    auto place = next;
    while (place != nearest && is_before(*next, place[-1])) --place;
    if (place != nearest) {
      const Event event = *next;
      std::move_backward(place, next, next + 1);
      *place = event;
      continue;
    }
    const auto is_elsewhere = [span = next->t >> span_bits, span_bits](const Event& event) {
      return event.t >> span_bits != span;
    };
    const auto first =
        std::find_if(std::reverse_iterator(next), events.rend(), is_elsewhere).base();
    next = std::find_if(next, events.end(), is_elsewhere);
    std::sort(first, next, is_before);
  }
}

/// Why a simulated pixel fired (docs/methods.md, Causes of events).
enum class Cause : std::uint8_t { unknown, light, leak, shot_noise, hot_pixel, exposure_pulse };

/// Event with a 64-bit time. Its label takes the space that alignment leaves.
struct AbsoluteEvent {
  Microseconds t;
  std::uint16_t x;             ///< column, from the left
  std::uint16_t y_p;           ///< row from the top in bits 0-14; bit 15 is the polarity, 1 = ON
  std::uint16_t object_class;  ///< in labelled streams only, like `cause`
  Cause cause;

  /// Leaves the members uninitialized: a vector grows at no cost, and decoders write in place.
  AbsoluteEvent() {}  // NOLINT(*-member-init,*-use-equals-default)
  constexpr AbsoluteEvent(Microseconds time, std::uint16_t column, std::uint16_t row_and_polarity)
      : t(time), x(column), y_p(row_and_polarity), object_class(0), cause(Cause::unknown) {}

  static constexpr AbsoluteEvent at(int x, int y, Microseconds t, Polarity polarity) {
    const auto event = Event::at(x, y, 0, polarity);
    return {t, event.x, event.y_p};
  }
  constexpr int y() const { return y_p & 0x7fff; }
  constexpr Polarity polarity() const { return (y_p & 0x8000) != 0 ? Polarity::on : Polarity::off; }

  /// Compares without the labels.
  friend constexpr bool operator==(const AbsoluteEvent& a, const AbsoluteEvent& b) {
    return a.t == b.t && a.x == b.x && a.y_p == b.y_p;
  }
};
static_assert(sizeof(AbsoluteEvent) == 16);

/// Edge on a trigger input of a camera.
struct Trigger {
  Microseconds t;
  std::uint16_t id;  ///< ID of the input
  bool rising;

  friend constexpr bool operator==(const Trigger&, const Trigger&) = default;
};

}  // namespace eventcamera
