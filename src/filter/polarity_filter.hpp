// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera {

/// Keeps the events of one polarity, and swaps ON and OFF of the kept events.
class PolarityFilter {
 public:
  enum class Kept { both, on, off };

  struct Settings {
    Kept keep = Kept::both;
    bool invert = false;
  };

  explicit PolarityFilter(SensorSize /*sensor*/) {}

  LabelledEvents filter(LabelledEvents events, Microseconds /*start*/,
                        const Settings& settings) const {
    const std::uint16_t inverted = settings.invert ? 0x8000 : 0;
    if (settings.keep == Kept::both) {
      for (auto& event : events.events) event.y_p ^= inverted;
      return events;
    }
    const int kept = settings.keep == Kept::on ? 1 : 0;
    return events.keep_if([=](Event& event) {
      const int polarity = event.y_p >> 15;
      event.y_p ^= inverted;
      return polarity == kept;
    });
  }
};

}  // namespace eventcamera
