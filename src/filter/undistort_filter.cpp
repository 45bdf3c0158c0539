// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/filter/undistort_filter.hpp"

#include <cmath>

#include "src/filter/filter.hpp"

namespace eventcamera {

UndistortFilter::UndistortFilter(SensorSize sensor, const CameraCalibration& calibration)
    : width_(static_cast<std::size_t>(sensor.width)) {
  targets_.reserve(width_ * static_cast<std::size_t>(sensor.height));
  for (int y = 0; y < sensor.height; ++y) {
    for (int x = 0; x < sensor.width; ++x) {
      const auto point = calibration.undistorted({static_cast<double>(x), static_cast<double>(y)});
      const double column = std::floor(point.x + 0.5);
      const double row = std::floor(point.y + 0.5);
      const bool is_inside =
          column >= 0 && column < sensor.width && row >= 0 && row < sensor.height;
      targets_.push_back(
          is_inside ? Target{static_cast<std::uint16_t>(column), static_cast<std::uint16_t>(row)}
                    : Target{0, outside});
    }
  }
}

LabelledEvents UndistortFilter::filter(LabelledEvents events) const {
  const auto prefetch = [this](const Event& event) { __builtin_prefetch(&target(event)); };
  return keep_if_prefetched(events, prefetch, [this](Event& event) {
    const auto [x, y] = target(event);
    event = {event.t, x, static_cast<std::uint16_t>((y & 0x7fff) | (event.y_p & 0x8000))};
    return y != outside;
  });
}

}  // namespace eventcamera
