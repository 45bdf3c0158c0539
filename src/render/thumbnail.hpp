// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "src/core/event.hpp"
#include "src/core/image.hpp"
#include "src/core/sensor_size.hpp"
#include "src/render/rgb_picture.hpp"

namespace eventcamera {

/// Small picture of a window of events. A pixel shows the polarity of the last event of the sensor
/// pixels that it covers, so that a single event is as visible as many.
///
/// The window ends when enough pixels have fired to see the scene.
class Thumbnail {
 public:
  /// At most `max_size` pixels wide and high, and not larger than the sensor.
  Thumbnail(SensorSize sensor, int max_size);

  SensorSize sensor() const { return sensor_; }

  /// Adds sorted events, with times relative to `start`, up to the end of the window. Skips events
  /// outside the sensor.
  void add(std::span<const Event> events, Microseconds start);

  /// True at the end of the window.
  bool is_full() const { return fired_ >= enough_; }

  /// True if the picture shows more than another, or as much in a shorter time.
  bool is_better_than(const Thumbnail& other) const;

  RgbPicture draw() const;

 private:
  SensorSize sensor_;
  Image<std::uint8_t> kinds_;  ///< bit of the last event's polarity: 1 OFF, 2 ON; 0 = none
  std::size_t enough_;         ///< pixels
  std::size_t fired_ = 0;      ///< pixels
  Microseconds first_ = 0;     ///< time of the first event
  Microseconds last_ = 0;      ///< time of the last event
};

}  // namespace eventcamera
