// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/gl/simulator.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera::gl {

/// As eventcamera::DenseSimulator, with Farneback's flow. Given the same flow, the events are the
/// same. Flow is computed for the whole frame, so where the CPU computes it only around the pixels
/// that changed, pyramid and borders differ; elsewhere the last bits of floating-point numbers.
class DenseSimulator : public Simulator {
 public:
  void set_interpolation(Interpolation interpolation) { interpolation_ = interpolation; }

 protected:
  using Simulator::Simulator;
  Interpolation interpolation_ = Interpolation::forward;
};

std::unique_ptr<DenseSimulator> make_dense_simulator(const Context& gl, const LumaFormat& format);

}  // namespace eventcamera::gl
