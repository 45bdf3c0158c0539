// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "src/dvs/dvs_settings.hpp"
#include "src/simulate/simulator.hpp"

// Guide to this folder: which file does what from frames to events, in this order. The equations
// are in docs/methods.md.
//
//   denoise.cpp           removes the noise of the frame camera
//   exposure_gain.cpp     finds how its exposure changed the light, which is divided out
//   sub_intervals.cpp     divides the interval into steps, and where exposure pulses begin and end;
//                         interval_plans.cpp: all its divisions, with bandwidth and noise, which
//                         depend on the light (shade_tables.hpp)
//   moving_light.cpp      number of steps between two frames for each tile, and the luma of moving
//                         pixels at each step; light_response.hpp: its response
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

  /// Returns all that the next events depend on, besides frames and settings: after restore() they
  /// are the same. There must have been a frame.
  virtual std::vector<std::uint8_t> state() = 0;

  /// Limit of the size of a state, bytes: a pixel has about 40, and 16 for each event that is late.
  std::size_t max_state_size() const {
    return (std::size_t{1} << 20) + std::size_t{1024} * static_cast<std::size_t>(format().width) *
                                        static_cast<std::size_t>(format().height);
  }

  /// Continues after the last frame of a simulator whose state() this is. Throws std::runtime_error
  /// with the reason if that had frames of another format or other settings, or if these bytes are
  /// not a state; then only reset(), restore() and the destructor may be called.
  virtual void restore(std::span<const std::uint8_t> state) = 0;

 protected:
  using Simulator::Simulator;
  DvsSettings settings_;
};

std::unique_ptr<DvsSimulator> make_dvs_simulator(const LumaFormat& format);

}  // namespace eventcamera
