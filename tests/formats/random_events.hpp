// SPDX-License-Identifier: LGPL-2.1-or-later
// Synthetic recordings: bursts at the same time, fast events, and silences of hours.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/sensor_size.hpp"

namespace eventcamera::random_events {

struct Silence {
  Microseconds most;  ///< maximum silence
};

/// Returns `count` sorted events from `start` on.
inline std::vector<AbsoluteEvent> make(SensorSize size, std::size_t count, unsigned seed,
                                       Microseconds start, Silence silence) {
  std::mt19937 random(seed);
  const auto below = [&](std::int64_t limit) {
    return std::uniform_int_distribution<std::int64_t>(0, limit - 1)(random);
  };
  std::vector<AbsoluteEvent> events;
  auto t = start;
  while (events.size() < count) {
    switch (below(200)) {
      case 0:
        t += below(silence.most);
        break;
      case 1:
      case 2:
      case 3:
        t += below(10'000);
        break;
      default:
        t += below(4) == 0 ? below(20) : 0;
    }
    events.push_back(AbsoluteEvent::at(static_cast<int>(below(size.width)),
                                       static_cast<int>(below(size.height)), t,
                                       below(2) == 1 ? Polarity::on : Polarity::off));
  }
  return events;
}

}  // namespace eventcamera::random_events
