// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <utility>

#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera {

/// One of the eight orientations of a picture: transposes first, then mirrors.
struct Orientation {
  bool transpose = false;  ///< (x, y) becomes (y, x)
  bool mirror_x = false;   ///< left becomes right
  bool mirror_y = false;   ///< top becomes bottom

  SensorSize size(SensorSize in) const { return transpose ? SensorSize{in.height, in.width} : in; }

  friend constexpr bool operator==(const Orientation&, const Orientation&) = default;
};

/// Flips and rotates a sensor. Keeps all events, in order.
class FlipFilter {
 public:
  FlipFilter(SensorSize in, Orientation orientation)
      : transpose_(orientation.transpose),
        x_(coordinate(orientation.mirror_x, orientation.size(in).width)),
        y_(coordinate(orientation.mirror_y, orientation.size(in).height)) {}

  LabelledEvents filter(LabelledEvents events) const {
    if (transpose_)
      map<true>(events);
    else
      map<false>(events);
    return events;
  }

 private:
  /// (value ^ mask) + offset: the value, or size - 1 - value.
  struct Coordinate {
    std::uint16_t mask;
    std::uint16_t offset;

    std::uint16_t operator()(unsigned value) const {
      return static_cast<std::uint16_t>((value ^ mask) + offset);
    }
  };
  static Coordinate coordinate(bool mirror, int size) {
    return mirror ? Coordinate{0xffff, static_cast<std::uint16_t>(size)} : Coordinate{0, 0};
  }

  template <bool transpose>
  void map(LabelledEvents events) const {
    for (auto& event : events.events) {
      unsigned x = event.x;
      unsigned y = event.y_p & 0x7fffU;
      if constexpr (transpose) std::swap(x, y);
      event.x = x_(x);
      event.y_p = static_cast<std::uint16_t>(y_(y) | (event.y_p & 0x8000U));
    }
  }

  bool transpose_;
  Coordinate x_;
  Coordinate y_;
};

}  // namespace eventcamera
