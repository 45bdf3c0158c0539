// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera {

/// Returns the first sensor that contains (x, y), or a size that just contains it if there is none.
/// Used for files that do not state the sensor size.
constexpr SensorSize sensor_with(int x, int y, std::span<const SensorSize> sensors) {
  for (const auto& sensor : sensors)
    if (x < sensor.width && y < sensor.height) return sensor;
  return {std::max(x + 1, sensors.back().width), std::max(y + 1, sensors.back().height)};
}

/// Commercial sensors.
inline constexpr SensorSize sensors[] = {{128, 128}, {240, 180}, {304, 240}, {320, 320}, {346, 260},
                                         {480, 360}, {640, 480}, {768, 512}, {1280, 720}};
/// Sensors whose files may have mirrored events.
inline constexpr SensorSize mirrored_sensors[] = {{240, 180}, {346, 260}, {640, 480}};

/// Last column and row of a sensor.
struct Extent {
  int x = 0;
  int y = 0;
};

/// Returns the smallest sensor with this extent. Used for files that do not state its size.
constexpr SensorSize sensor_with(Extent extent, bool mirrored) {
  return mirrored ? sensor_with(extent.x, extent.y, mirrored_sensors)
                  : sensor_with(extent.x, extent.y, sensors);
}

/// Columns and rows of events, to guess a sensor size that the file does not state.
///
/// Uses most of the events, since a corrupt one may be anywhere: an event is stray if no sensor is
/// that large, or if it lies more than twice as far out as nearly all others.
class UsedPixels {
 public:
  static constexpr int max_guessed_side = 4096;

  void include(std::span<const AbsoluteEvent> events) {
    columns_.resize(max_guessed_side);
    rows_.resize(max_guessed_side);
    for (const auto& event : events) {
      if (event.x >= max_guessed_side || event.y() >= max_guessed_side) {
        ++beyond_;
        continue;
      }
      ++columns_[event.x];
      ++rows_[static_cast<std::size_t>(event.y())];
      ++within_;
    }
  }

  /// The last column and row with events, other than up to `strays` far out; at least `known`.
  Extent extent(std::uint64_t strays, Extent known = {}) const {
    return {last_used(columns_, strays, known.x), last_used(rows_, strays, known.y)};
  }

  std::uint64_t within() const { return within_; }

  /// True if more than one, and more than 1 in 100, of these and `outside` further events lie
  /// beyond any sensor: their coordinates are not pixels.
  bool are_implausible(std::uint64_t outside) const {
    const auto beyond = beyond_ + outside;
    return beyond > std::max<std::uint64_t>(1, (within_ + beyond) / 100);
  }

 private:
  using Counts = std::vector<std::uint64_t>;

  static int last_used(const Counts& counts, std::uint64_t strays, int known) {
    const auto last_at = static_cast<int>(counts.size()) - 1;
    const auto nearly_all = std::max(known, last_but(counts, last_at, strays));
    return std::max(known, last_but(counts, std::min(last_at, 2 * nearly_all + 1), 0));
  }

  /// Returns the last used index up to `last`, ignoring `strays` events; 0 if there is none.
  static int last_but(const Counts& counts, int last, std::uint64_t strays) {
    for (std::uint64_t beyond = 0; last > 0; --last)
      if ((beyond += counts[static_cast<std::size_t>(last)]) > strays) break;
    return std::max(last, 0);
  }

  Counts columns_;
  Counts rows_;
  std::uint64_t within_ = 0;
  std::uint64_t beyond_ = 0;
};

/// Predicate for events outside a sensor.
inline auto is_outside(SensorSize size) {
  return [size](const AbsoluteEvent& event) {
    return event.x >= size.width || event.y() >= size.height;
  };
}

}  // namespace eventcamera
