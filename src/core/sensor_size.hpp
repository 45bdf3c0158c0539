// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

namespace eventcamera {

/// Sensor size in pixels.
struct SensorSize {
  int width = 0;
  int height = 0;

  friend constexpr bool operator==(const SensorSize&, const SensorSize&) = default;
};

/// Text for messages: "640 x 480 pixels".
inline std::string in_pixels(const SensorSize& size) {
  return std::to_string(size.width) + " x " + std::to_string(size.height) + " pixels";
}

}  // namespace eventcamera
