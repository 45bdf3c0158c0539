// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/dvs/dvs_settings.hpp"
#include "src/simulate/simulator.hpp"

namespace eventcamera {

/// A physical pixel array: logarithmic light, a photoreceptor of limited bandwidth, memory,
/// mismatch, leak, shot noise, refractory time, readout. Each crossing of a threshold has its own
/// time. The thresholds are those of DvsSettings; of Settings only the threads count.
class DvsSimulator : public Simulator {
 public:
  /// For the frames to come.
  void set(const DvsSettings& settings) { settings_ = settings; }

 protected:
  using Simulator::Simulator;
  DvsSettings settings_;
};

std::unique_ptr<DvsSimulator> make_dvs_simulator(const LumaFormat& format);

}  // namespace eventcamera
