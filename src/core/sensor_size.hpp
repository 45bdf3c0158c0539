// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string>

namespace eventcamera {

/// Maximum width and height of frames and sensors, in pixels.
inline constexpr int max_side = 16384;

/// True if frames and sensors may have this width or height.
constexpr bool is_side(std::int64_t pixels) {
  return pixels > 0 && pixels <= max_side;
}

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
