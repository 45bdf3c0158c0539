// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/flow/dense_flow.hpp"
#include "src/simulate/simulator.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera {

/// Dense frame interpolation (paper, section III-A): frames between I(i-1) and I(i) are sampled
/// bilinearly along the flow F from I(i-1) to I(i), with replicated borders; I(1) = I(i).
/// Differences of successive frames are thresholded; events take the time of the later frame.
class DenseSimulator : public Simulator {
 public:
  void set_flow(FlowMethod method) { method_ = method; }
  void set_interpolation(Interpolation interpolation) { interpolation_ = interpolation; }

 protected:
  using Simulator::Simulator;
  FlowMethod method_ = FlowMethod::dis_lq;
  Interpolation interpolation_ = Interpolation::forward;
};

/// Width and height of `format` must not exceed max_side.
std::unique_ptr<DenseSimulator> make_dense_simulator(const LumaFormat& format);

}  // namespace eventcamera
