// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Takes the numbers that are read from a table: an event outside the sensor is dropped, one
/// earlier than another before it is delivered, and both are counted.
class EventIntake {
 public:
  /// 0x0 where the size is not known: all that StampedEvent can hold is inside.
  void set_size(SensorSize size) {
    x_end_ = size.width > 0 ? static_cast<std::uint64_t>(std::min(size.width, most_x)) : most_x;
    y_end_ = size.height > 0 ? static_cast<std::uint64_t>(std::min(size.height, most_y)) : most_y;
  }

  void take(Microseconds t, std::int64_t x, std::int64_t y, bool on, std::vector<StampedEvent>& out,
            Damage& damage) {
    if (static_cast<std::uint64_t>(x) >= x_end_ || static_cast<std::uint64_t>(y) >= y_end_) {
      ++damage.outside;
      return;
    }
    if (t < latest_) {
      ++damage.unsorted;
    } else {
      latest_ = t;
    }
    out.push_back(
        {t, static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y | (on ? 0x8000 : 0))});
  }

  /// What comes next may be earlier.
  void restart() { latest_ = std::numeric_limits<Microseconds>::min(); }

 private:
  static constexpr int most_x = 0x10000;
  static constexpr int most_y = 0x8000;

  std::uint64_t x_end_ = most_x, y_end_ = most_y;
  Microseconds latest_ = std::numeric_limits<Microseconds>::min();
};

}  // namespace eventcamera
