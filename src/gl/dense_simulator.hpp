// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/gl/simulator.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera::gl {

/// Like eventcamera::DenseSimulator, with Farneback's flow; the same flow gives the same events.
/// Flow is always computed for the whole frame. If the CPU computes it only around changed pixels,
/// pyramid and borders differ; otherwise the last bits of floating-point numbers may differ.
class DenseSimulator : public Simulator {
 public:
  void set_interpolation(Interpolation interpolation) { interpolation_ = interpolation; }

 protected:
  using Simulator::Simulator;
  Interpolation interpolation_ = Interpolation::forward;
};

std::unique_ptr<DenseSimulator> make_dense_simulator(const Context& gl, const LumaFormat& format);

}  // namespace eventcamera::gl
