// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/dvs/dvs_settings.hpp"
#include "src/simulate/simulator.hpp"

namespace eventcamera {

/// Simulates a physical pixel array: logarithmic response, photoreceptor bandwidth, reference
/// level, threshold mismatch, leak, shot noise, refractory period, readout. Each threshold crossing
/// has its own time. Thresholds come from DvsSettings; only `threads` of Settings is used.
class DvsSimulator : public Simulator {
 public:
  /// Applies to the next frames.
  void set(const DvsSettings& settings) { settings_ = settings; }

 protected:
  using Simulator::Simulator;
  DvsSettings settings_;
};

std::unique_ptr<DvsSimulator> make_dvs_simulator(const LumaFormat& format);

}  // namespace eventcamera
