// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera {

static_assert(max_side <= int{coordinate_bits} + 1);

/// Stores a cause in the spare bits of an event's coordinates, where simulators carry it until
/// events are written. is_before() ignores these bits.
constexpr Event with_cause(Event event, Cause cause) {
  const auto bits = static_cast<unsigned>(cause);
  event.x = static_cast<std::uint16_t>(event.x | (bits & 3) << 14);
  event.y_p = static_cast<std::uint16_t>(event.y_p | (bits & 4) << 12);
  return event;
}

constexpr Cause cause_of(const Event& event) {
  return static_cast<Cause>((event.x >> 14 & 3) | (event.y_p >> 12 & 4));
}

constexpr Event without_cause(Event event) {
  event.x &= coordinate_bits;
  event.y_p &= coordinate_bits | 0x8000;
  return event;
}

/// Label of an event, in the layout of GstEventCameraLabel.
struct Label {
  std::uint16_t object_class = 0;  ///< class of the object that the pixel saw, 0 = unknown
  Cause cause = Cause::unknown;
  std::uint8_t reserved = 0;

  friend constexpr bool operator==(const Label&, const Label&) = default;
};
static_assert(sizeof(Label) == 4);

constexpr Label label_of(const AbsoluteEvent& event) {
  return {.object_class = event.object_class, .cause = event.cause};
}

constexpr void set_label(AbsoluteEvent& event, const Label& label) {
  event.object_class = label.object_class;
  event.cause = label.cause;
}

/// Sorted events of an interval and, if they are labelled, a label for each.
struct LabelledEvents {
  std::span<Event> events;
  std::span<Label> labels;  ///< one per event, or empty

  /// Moves the events for which keep(Event&) is true to the front, in order and with their labels,
  /// and returns them. Calls `keep`, which may change the event, once for each, in order.
  template <class Keep>
  LabelledEvents keep_if(Keep keep) const {
    // Locals, which stores cannot alias.
    Event* const event = events.data();
    Label* const label = labels.empty() ? nullptr : labels.data();
    const std::size_t size = events.size();
    std::size_t kept = 0;
    for (std::size_t i = 0; i < size; ++i) {
      Event next = event[i];
      const bool is_kept = keep(next);  // a single call site is inlined
      event[kept] = next;
      if (label != nullptr) label[kept] = label[i];
      kept += static_cast<std::size_t>(is_kept);
    }
    return {events.first(kept), labels.first(label != nullptr ? kept : 0)};
  }
};

/// Moves the causes of events from with_cause() to their labels.
inline void separate_causes(const LabelledEvents& labelled) {
  for (std::size_t i = 0; i < labelled.events.size(); ++i) {
    auto& event = labelled.events[i];
    labelled.labels[i] = {.cause = cause_of(event)};
    event = without_cause(event);
  }
}

}  // namespace eventcamera
