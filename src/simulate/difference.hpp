// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/event/event.hpp"
#include "src/simulate/simulator.hpp"

namespace eventcamera {

/// Fires where a row of pixels changed by more than the thresholds: ON where now - before > C+,
/// OFF where before - now > C- (paper, section III-A).
template <class Pixel>
void fire_differences(const Pixel* before, const Pixel* now, int width, int y, std::uint32_t t,
                      const Thresholds& thresholds, std::vector<Event>& out) {
  for (int x = 0; x < width; ++x) {
    const int difference = now[x] - before[x];
    if (difference > thresholds.positive)
      out.push_back(Event::at(x, y, t, Polarity::on));
    else if (-difference > thresholds.negative)
      out.push_back(Event::at(x, y, t, Polarity::off));
  }
}

}  // namespace eventcamera
