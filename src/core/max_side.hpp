// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace eventcamera {

/// Maximum width and height of frames and sensors, in pixels.
inline constexpr int max_side = 16384;

}  // namespace eventcamera
