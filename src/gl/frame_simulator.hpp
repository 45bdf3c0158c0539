// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/gl/simulator.hpp"

namespace eventcamera::gl {

/// The same events as eventcamera::make_frame_simulator() for the same luma.
std::unique_ptr<Simulator> make_frame_simulator(const Context& gl, const LumaFormat& format);

}  // namespace eventcamera::gl
