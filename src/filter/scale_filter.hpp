// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera {

/// Scales a sensor. Events of one output pixel, polarity and microsecond become one, unless the
/// sensor keeps its size. Optionally keeps one of every min_events events of an output pixel and
/// polarity. 8 bytes per output pixel.
class ScaleFilter {
 public:
  struct Settings {
    /// Keeps the last of every min_events events; 1 to max_min_events.
    unsigned min_events = 1;
  };
  static constexpr unsigned max_min_events = 65535;

  ScaleFilter(SensorSize in, SensorSize out);

  LabelledEvents filter(LabelledEvents events, Microseconds start, const Settings& settings);

  void forget();

 private:
  /// Number of a microsecond with events, from 1; 0 is none.
  using Moment = std::uint16_t;

  struct Row {
    std::uint32_t first;  ///< index of its first pixel
    std::uint16_t y;
  };

  /// Pixel of the output and polarity.
  std::size_t index(const Event& event) const {
    return (rows_[static_cast<std::size_t>(event.y())].first + columns_[event.x]) * 2U +
           (event.y_p >> 15U);
  }
  template <bool counts>
  LabelledEvents filter(LabelledEvents events, Microseconds start, unsigned min_events);

  bool is_same_size_;
  std::vector<std::uint16_t> columns_;  ///< of the output, by column of the input
  std::vector<Row> rows_;
  std::vector<Moment> last_kept_;      ///< time of the last event kept, by pixel and polarity
  std::vector<std::uint16_t> counts_;  ///< events since
  Moment moment_ = 0;                  ///< of the last event
  Microseconds time_ = std::numeric_limits<Microseconds>::min() / 2;
};

}  // namespace eventcamera
