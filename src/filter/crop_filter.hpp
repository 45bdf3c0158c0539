// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera {

/// Keeps the events of a region of the sensor, whose top left pixel becomes (0, 0).
class CropFilter {
 public:
  /// Numbers of pixels removed at each side.
  struct Settings {
    unsigned left = 0;
    unsigned right = 0;
    unsigned top = 0;
    unsigned bottom = 0;
  };

  /// The region starts at the left and top of the settings, and has the size `out`.
  CropFilter(SensorSize /*in*/, SensorSize out)
      : width_(static_cast<std::uint16_t>(out.width)),
        height_(static_cast<std::uint16_t>(out.height)) {}

  LabelledEvents filter(LabelledEvents events, Microseconds /*start*/,
                        const Settings& settings) const {
    const auto left = static_cast<std::uint16_t>(settings.left);
    const auto top = static_cast<std::uint16_t>(settings.top);
    return events.keep_if([*this, left, top](Event& event) {
      // Pixels before the region wrap past its end.
      const auto x = static_cast<std::uint16_t>(event.x - left);
      const auto y = static_cast<std::uint16_t>(event.y() - top);
      event.x = x;
      event.y_p = static_cast<std::uint16_t>(event.y_p - top);  // does not change the polarity
      return ((x < width_) & (y < height_)) != 0;               // without a branch
    });
  }

 private:
  std::uint16_t width_;
  std::uint16_t height_;
};

}  // namespace eventcamera
