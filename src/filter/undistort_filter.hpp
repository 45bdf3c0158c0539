// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"
#include "src/filter/camera_calibration.hpp"

namespace eventcamera {

/// Moves each event to the pixel where a camera of the same matrix without distortion would see it,
/// and drops events that leave the picture. A look-up table: 4 bytes per pixel.
class UndistortFilter {
 public:
  UndistortFilter(SensorSize sensor, const CameraCalibration& calibration);

  LabelledEvents filter(LabelledEvents events) const;

 private:
  /// Pixel of the undistorted picture.
  struct Target {
    std::uint16_t x;
    std::uint16_t y;
  };
  static constexpr std::uint16_t outside = 0xffff;  ///< y of pixels that leave the picture

  const Target& target(const Event& event) const {
    return targets_[static_cast<std::size_t>(event.y()) * width_ + event.x];
  }

  std::size_t width_;
  std::vector<Target> targets_;
};

}  // namespace eventcamera
