// SPDX-License-Identifier: LGPL-2.1-or-later
// Events as rows of numbers: in text, NumPy's arrays and HDF5.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "src/formats/decoder.hpp"

namespace eventcamera {

enum class EventColumn : std::uint8_t { t, x, y, p };

/// The column that a name means in any tool, in upper or lower case. What follows a space, '@',
/// '[' or '(' (a unit, a size) is ignored.
std::optional<EventColumn> event_column_named(std::string_view name);

using ColumnOrder = std::array<EventColumn, 4>;

/// The order that a word such as "txyp" means; nothing where a letter is missing or not one of
/// these.
std::optional<ColumnOrder> column_order(std::string_view letters);

enum class TimeUnit : std::uint8_t { seconds, microseconds, nanoseconds };

/// Makes events of the numbers in a row: one outside the sensor is dropped, one earlier than
/// another before it is kept, and both are counted.
class RowValidator {
 public:
  /// 0x0 is an unknown size: all that AbsoluteEvent can hold is inside.
  void set_size(SensorSize size) {
    x_end_ = size.width > 0 ? static_cast<std::uint64_t>(std::min(size.width, max_x)) : max_x;
    y_end_ = size.height > 0 ? static_cast<std::uint64_t>(std::min(size.height, max_y)) : max_y;
  }

  void take(Microseconds t, std::int64_t x, std::int64_t y, bool on,
            std::vector<AbsoluteEvent>& out, Corruption& corruption) {
    if (static_cast<std::uint64_t>(x) >= x_end_ || static_cast<std::uint64_t>(y) >= y_end_) {
      ++corruption.outside;
      return;
    }
    if (t < latest_) {
      ++corruption.unsorted;
    } else {
      latest_ = t;
    }
    out.push_back(
        {t, static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y | (on ? 0x8000 : 0))});
  }

  /// The next event may be earlier.
  void restart() { latest_ = std::numeric_limits<Microseconds>::min(); }

 private:
  static constexpr int max_x = 0x10000;
  static constexpr int max_y = 0x8000;

  std::uint64_t x_end_ = max_x, y_end_ = max_y;
  Microseconds latest_ = std::numeric_limits<Microseconds>::min();
};

}  // namespace eventcamera
