// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

namespace eventcamera {

/// Maximum width and height of frames and sensors, in pixels.
inline constexpr int max_side = 16384;

/// True if frames and sensors may have this width or height.
constexpr bool is_side(std::int64_t pixels) {
  return pixels > 0 && pixels <= max_side;
}

}  // namespace eventcamera
