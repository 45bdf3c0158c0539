// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera {

/// Keeps the events of some pixels. One bit per pixel.
class PixelMask {
 public:
  /// Keeps no pixel.
  explicit PixelMask(SensorSize sensor);

  /// Keeps the pixels that are brighter than mid-grey in a PNG picture of the sensor's size, over a
  /// black background. Throws std::runtime_error if it is not a PNG, or has another size.
  static PixelMask parse_png(std::string_view png, SensorSize sensor);

  void keep(int x, int y) {
    const auto place = index(x, y);
    words_[place / 64] |= std::uint64_t{1} << (place % 64);
  }
  bool keeps(int x, int y) const {
    const auto place = index(x, y);
    return ((words_[place / 64] >> (place % 64)) & 1) != 0;
  }

  LabelledEvents filter(LabelledEvents events) const {
    return events.keep_if([this](const Event& event) { return keeps(event.x, event.y()); });
  }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * width_ + static_cast<std::size_t>(x);
  }

  std::size_t width_;
  std::vector<std::uint64_t> words_;
};

}  // namespace eventcamera
