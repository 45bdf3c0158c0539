// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>

#include "src/core/event_validator.hpp"
#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera {

/// Filters an event stream in place: moves the kept events to the front, in order and with their
/// labels, and returns them.
///
/// Events are inside the sensor and sorted; their times are relative to `start`, and not before the
/// previous call's. The result does not depend on how a stream is cut into calls. A filter that
/// remembers times also has forget(), after which time may start over.
template <class Type>
concept Filter = requires(Type filter, LabelledEvents events, Microseconds start,
                          const typename Type::Settings& settings) {
  { filter.filter(events, start, settings) } -> std::same_as<LabelledEvents>;
};

/// Drops events that are outside the sensor, earlier than a previous one, or later than `max_t`.
/// Returns the rest.
inline LabelledEvents keep_valid(LabelledEvents events, SensorSize sensor, std::uint32_t max_t,
                                 InvalidEvents& invalid) {
  // The sign bit is set if any event is invalid; nearly always none is.
  std::int64_t signs = 0;
  std::int64_t previous = 0;
  for (const auto& event : events.events) {
    const std::int64_t t = event.t;
    signs |= (sensor.width - 1 - event.x) | (sensor.height - 1 - event.y()) | (t - previous);
    previous = t;
  }
  if ((signs | (max_t - previous)) >= 0) return events;

  std::uint32_t earliest = 0;
  return events.keep_if([&](const Event& event) {
    const bool is_outside = event.x >= sensor.width || event.y() >= sensor.height;
    const bool is_unsorted = event.t < earliest || event.t > max_t;
    invalid.outside += is_outside ? 1 : 0;
    invalid.unsorted += !is_outside && is_unsorted ? 1 : 0;
    if (is_outside || is_unsorted) return false;
    earliest = event.t;
    return true;
  });
}

/// LabelledEvents::keep_if() for a filter that looks something up for each event: calls
/// prefetch(event) ahead of time, because the data of a random pixel is rarely in the cache.
template <class Prefetch, class Keep>
LabelledEvents keep_if_prefetched(LabelledEvents events, Prefetch prefetch, Keep keep) {
  constexpr std::size_t distance = 32;
  const Event* const data = events.events.data();
  const std::size_t last = std::max<std::size_t>(events.events.size(), 1) - 1;
  // Captures by value, so stores to events cannot alias the captures.
  return events.keep_if([=, next = distance](Event& event) mutable {
    prefetch(data[std::min(next++, last)]);
    return keep(event);
  });
}

}  // namespace eventcamera
