// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "src/core/event.hpp"

namespace eventcamera {

/// The order of events in a stream: by time, and within a time in raster order.
inline bool is_before(const Event& a, const Event& b) {
  const auto place = [](const Event& event) {
    return static_cast<std::uint32_t>(event.y()) << 16 | event.x;
  };
  return a.t != b.t ? a.t < b.t : place(a) < place(b);
}

/// Brings events that are sorted by time alone into that order, in which most of them are already.
inline void sort_within_times(std::vector<Event>& events) {
  for (auto run = events.begin(); run != events.end();) {
    const auto end =
        std::find_if(run, events.end(), [&](const Event& event) { return event.t != run->t; });
    if (!std::is_sorted(run, end, is_before)) std::sort(run, end, is_before);
    run = end;
  }
}

}  // namespace eventcamera
