// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/gl/simulator.hpp"

namespace eventcamera::gl {

/// Like eventcamera::make_frame_simulator(); the same luma gives the same events.
std::unique_ptr<Simulator> make_frame_simulator(const Context& gl, const LumaFormat& format);

}  // namespace eventcamera::gl
