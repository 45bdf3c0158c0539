// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/event/event.hpp"
#include "src/simulate/simulator.hpp"

namespace eventcamera {

/// Fires where a row of pixels changed by more than the thresholds: ON where now - before > C+,
/// OFF where before - now > C- (paper, section III-A).
void fire_differences(const std::uint8_t* before, const std::uint8_t* now, int width, int y,
                      std::uint32_t t, const Thresholds& thresholds, std::vector<Event>& out);
void fire_differences(const std::uint16_t* before, const std::uint16_t* now, int width, int y,
                      std::uint32_t t, const Thresholds& thresholds, std::vector<Event>& out);

}  // namespace eventcamera
