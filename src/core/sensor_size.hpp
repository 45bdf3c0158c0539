// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace eventcamera {

/// Sensor size in pixels.
struct SensorSize {
  int width = 0;
  int height = 0;

  friend constexpr bool operator==(const SensorSize&, const SensorSize&) = default;
};

}  // namespace eventcamera
