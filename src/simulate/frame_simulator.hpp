// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/simulate/simulator.hpp"

namespace eventcamera {

/// Frame differencing (paper, section III): ON where I(i) - I(i-1) > C+, OFF where I(i-1) - I(i) >
/// C-, all at the time of I(i). No frames are interpolated.
std::unique_ptr<Simulator> make_frame_simulator(const LumaFormat& format);

}  // namespace eventcamera
