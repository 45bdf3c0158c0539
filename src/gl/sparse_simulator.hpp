// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/gl/simulator.hpp"

namespace eventcamera::gl {

/// Like eventcamera::make_sparse_simulator(). The same tracks give the same events; tracks may
/// differ in the last bits of floating-point numbers.
std::unique_ptr<Simulator> make_sparse_simulator(const Context& gl, const LumaFormat& format);

}  // namespace eventcamera::gl
