// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <span>

#include "src/core/image.hpp"
#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"
#include "src/filter/stamp_clock.hpp"

namespace eventcamera {

/// A cell for each pixel, which holds stamps, and a margin of pixels that never fire. A cell of all
/// zeros has seen no event. Cells other than Stamp have lower(amount).
template <class Cell>
class StampedPixels {
 public:
  explicit StampedPixels(SensorSize sensor, int margin = 0)
      : cells_(sensor.width, sensor.height, margin) {}

  /// Filters events: keep(event, now, cell) decides on each, in order.
  template <class Keep>
  LabelledEvents keep_if(LabelledEvents events, Microseconds start, const Keep& keep) {
    // Pixels of random events are not in the cache: load those of events to come.
    constexpr std::size_t distance = 16;
    const Event* ahead = events.events.data();
    const Event* const last = ahead + events.events.size() - 1;
    ahead = events.events.size() > distance ? ahead + distance : last;
    return events.keep_if([&](const Event& event) {
      prefetch(*ahead);
      ahead = std::min(ahead + 1, last);
      return keep(event, now(start + event.t), at(event));
    });
  }

  /// The cell of an event's pixel; the next row is stride() bytes further.
  Cell* at(const Event& event) { return cells_.row(event.y()) + event.x; }
  std::ptrdiff_t stride() const { return cells_.stride(); }

  void forget() {
    for (int y = 0; y < cells_.height(); ++y) std::fill_n(cells_.row(y), cells_.width(), Cell{});
    clock_ = {};
  }

 private:
  Stamp now(Microseconds time) {
    return clock_.at(time, [this](std::uint64_t amount) { lower(amount); });
  }

  void lower(std::uint64_t amount) {
    for (int y = 0; y < cells_.height(); ++y)
      for (auto& cell : std::span(cells_.row(y), static_cast<std::size_t>(cells_.width())))
        if constexpr (std::same_as<Cell, Stamp>)
          cell = lowered(cell, amount);
        else
          cell.lower(amount);
  }

  void prefetch(const Event& event) {
    for (int row = -cells_.margin(); row <= cells_.margin(); ++row)
      __builtin_prefetch(cells_.row(event.y() + row) + event.x, 1);
  }

  Image<Cell> cells_;
  StampClock clock_;
};

}  // namespace eventcamera
