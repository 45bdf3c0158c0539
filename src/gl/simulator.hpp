// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/gl/grey_frame.hpp"
#include "src/simulate/simulator.hpp"

namespace eventcamera::gl {

/// Simulator of 8-bit frames in textures. It is made, used and destroyed while its context is
/// current; hold_until() and reset() need none. push() throws Error as well.
using Simulator = BasicSimulator<TextureFrame>;

}  // namespace eventcamera::gl
