// SPDX-License-Identifier: LGPL-2.1-or-later
// The filters of events, written as plainly as their definitions: 64-bit times of all pixels, one
// event after another.
#pragma once

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"

namespace reference {

using eventcamera::AbsoluteEvent;
using eventcamera::Microseconds;
using eventcamera::SensorSize;

using Events = std::vector<AbsoluteEvent>;

/// Something for each pixel that has had an event.
template <class Value>
using OfPixels = std::map<std::pair<int, int>, Value>;

inline Events refractory(const Events& events, Microseconds period) {
  Events kept;
  OfPixels<Microseconds> last_kept;
  for (const auto& event : events) {
    const auto last = last_kept.find({event.x, event.y()});
    if (last != last_kept.end() && event.t - last->second < period) continue;
    last_kept[{event.x, event.y()}] = event.t;
    kept.push_back(event);
  }
  return kept;
}

}  // namespace reference
