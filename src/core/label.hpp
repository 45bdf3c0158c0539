// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "src/core/event.hpp"

namespace eventcamera {

/// What made a simulated pixel fire.
enum class Cause : std::uint8_t { unknown, light, leak, shot_noise, hot_pixel, exposure_pulse };

/// Label of an event, in the layout of GstEventCameraLabel.
struct Label {
  std::uint16_t object_class = 0;  ///< class of the object that the pixel saw, 0 = none
  Cause cause = Cause::unknown;
  std::uint8_t reserved = 0;

  friend constexpr bool operator==(const Label&, const Label&) = default;
};
static_assert(sizeof(Label) == 4);

/// Sorted events of an interval and, if they are labelled, a label for each.
struct LabelledEvents {
  std::span<Event> events;
  std::span<Label> labels;  ///< as many as events, or empty

  /// Moves the events for which keep(Event&) is true to the front, in order and with their labels,
  /// and returns them. `keep` is called once for each event, in order, and may change it.
  template <class Keep>
  LabelledEvents keep_if(Keep keep) const {
    std::size_t kept = 0;
    const auto compact = [&](auto keep_label) {
      for (std::size_t i = 0; i < events.size(); ++i) {
        Event event = events[i];
        const bool is_kept = keep(event);
        events[kept] = event;
        keep_label(i);
        kept += is_kept ? 1 : 0;
      }
    };
    if (labels.empty()) {
      compact([](std::size_t) {});
      return {events.first(kept), {}};
    }
    compact([&](std::size_t i) { labels[kept] = labels[i]; });
    return {events.first(kept), labels.first(kept)};
  }
};

}  // namespace eventcamera
