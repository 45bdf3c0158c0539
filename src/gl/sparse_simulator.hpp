// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/gl/simulator.hpp"

namespace eventcamera::gl {

/// As eventcamera::make_sparse_simulator(). Given the same tracks, the events are the same; tracks
/// may differ in the last bits of floating-point numbers.
std::unique_ptr<Simulator> make_sparse_simulator(const Context& gl, const LumaFormat& format);

}  // namespace eventcamera::gl
