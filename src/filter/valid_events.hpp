// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/invalid_events.hpp"
#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera {

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

}  // namespace eventcamera
