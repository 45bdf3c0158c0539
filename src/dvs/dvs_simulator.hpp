// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/dvs/dvs_settings.hpp"
#include "src/simulate/simulator.hpp"

// Guide to this folder: which file does what from frames to events, in this order. The equations
// are in docs/methods.md.
//
//   denoise.cpp           removes the noise of the frame camera
//   exposure_gain.cpp     finds how its exposure changed the light, which is divided out
//   motion_tiles.cpp      number of steps between two frames for each tile
//   sub_intervals.cpp     divides the interval into steps, and where exposure pulses begin and end;
//                         interval_plans.cpp: all its divisions, with bandwidth and noise, which
//                         depend on the light (shade_tables.hpp)
//   moving_light.cpp      luma of moving pixels at each step; light_response.hpp: its response
//   row_filter.cpp        advances pixels that cannot fire, usually most of them; the others,
//                         candidates, are solved: they get the exact times of their events
//   pixel_solver.cpp      solves one at a time, with crossings (trajectory.cpp), adaptation.hpp,
//                         shot_noise.hpp, latency and refractory period; chooses the solver
//   line_solver.cpp       the same for many straight lines at a time, without latency
//   row_solver.cpp        the same for many pixels at a time whose thresholds do not vary
//   interval_events.hpp   collects the events, and defers those past the interval
//   readout.cpp           reads them out row by row at a limited rate
// Pixels have the state and the mismatch of pixel_array.cpp, and random numbers of random.hpp.

namespace eventcamera {

/// Simulates a physical pixel array: logarithmic response, photoreceptor bandwidth, reference
/// level, threshold mismatch, leak, shot noise, refractory period, readout. Each threshold crossing
/// has its own time. Thresholds come from DvsSettings; only `threads` and `labels` of Settings are
/// used.
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
