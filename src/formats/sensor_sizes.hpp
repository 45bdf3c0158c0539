// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
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

/// Extent of the pixels with events, to guess a sensor size that the file does not state.
class UsedPixels {
 public:
  void include(std::span<const AbsoluteEvent> events) {
    for (const auto& event : events) {
      max_x_ = std::max<int>(max_x_, event.x);
      max_y_ = std::max(max_y_, event.y());
    }
  }

  SensorSize sensor(bool mirrored) const {
    if (mirrored) return sensor_with(max_x_, max_y_, mirrored_sensors);
    return sensor_with(max_x_, max_y_, sensors);
  }

 private:
  int max_x_ = 0;
  int max_y_ = 0;
};

/// Predicate for events outside a sensor.
inline auto is_outside(SensorSize size) {
  return [size](const AbsoluteEvent& event) {
    return event.x >= size.width || event.y() >= size.height;
  };
}

}  // namespace eventcamera
