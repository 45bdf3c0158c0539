// SPDX-License-Identifier: LGPL-2.1-or-later
// What filters that move events do, one event at a time.
#pragma once

#include <map>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"

namespace reference {

using eventcamera::AbsoluteEvent;
using eventcamera::SensorSize;
using Pixel = std::pair<int, int>;

/// Moves each event to the pixel that move(x, y) returns, if any.
template <class Move>
std::vector<AbsoluteEvent> moved(const std::vector<AbsoluteEvent>& events, const Move& move) {
  std::vector<AbsoluteEvent> result;
  for (const auto& event : events)
    if (const std::optional<Pixel> pixel = move(event.x, event.y()))
      result.push_back(AbsoluteEvent::at(pixel->first, pixel->second, event.t, event.polarity()));
  return result;
}

/// Events of the output's pixels: the last of `min_events`, but not two in a microsecond.
inline std::vector<AbsoluteEvent> scaled(const std::vector<AbsoluteEvent>& events, SensorSize in,
                                         SensorSize out, unsigned min_events) {
  struct Cell {
    unsigned count = 0;
    std::optional<eventcamera::Microseconds> last{};
  };
  std::map<std::tuple<int, int, eventcamera::Polarity>, Cell> cells;
  std::vector<AbsoluteEvent> result;
  for (const auto& event : events) {
    const int x = event.x * out.width / in.width;
    const int y = event.y() * out.height / in.height;
    auto& cell = cells[{x, y, event.polarity()}];
    if (++cell.count < min_events) continue;
    cell.count = 0;
    if (cell.last == event.t) continue;
    cell.last = event.t;
    result.push_back(AbsoluteEvent::at(x, y, event.t, event.polarity()));
  }
  return result;
}

}  // namespace reference
