// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/dvs/dvs_settings.hpp"
#include "src/simulate/simulator.hpp"

// Guide to this folder, from frames to events; the equations are in docs/methods.md.
//
//   light_response.cpp    response of the photoreceptor to luma, without the exposure that
//                         exposure_gain.cpp finds
//   frame_pair.hpp        exposure, optical flow and sharpness of the frames of an interval
//   motion_deblur.cpp     sharpens frames of long exposures along their motion
//   moving_light.cpp      number of steps between two frames for each tile, and the luma of moving
//                         pixels at each step
//   sub_intervals.cpp     timeline: divides the interval into sub-intervals at steps and exposure
//                         pulses, with tables of bandwidth and noise, which depend on the light
//   pixel_model.cpp       parameters shared by all pixels, and their mismatch
//   pixel_array.cpp       state of all pixels
//   row_filter.cpp        advances pixels that cannot fire, usually most of them; the others,
//                         candidates, are solved: they get the exact times of their events
//   pixel_solver.cpp      solves any pixel, one at a time, with the crossings of trajectory.cpp
//   line_solver.cpp       many straight lines at a time, without latency
//   row_solver.cpp        many pixels at a time whose thresholds do not vary
//   interval_events.hpp   collects the events, and defers those past the interval
//   readout.cpp           reads them out row by row at a limited rate

namespace eventcamera {

/// Simulates a physical pixel array: logarithmic response, photoreceptor bandwidth, reference
/// level, threshold mismatch, leak, shot noise, refractory period, readout. Each threshold crossing
/// has its own time. Thresholds come from DvsSettings; only `threads` and `labels` of Settings are
/// used.
class DvsSimulator : public Simulator {
 public:
  void set(const DvsSettings& settings) { settings_ = settings; }

 protected:
  using Simulator::Simulator;
  DvsSettings settings_;
};

std::unique_ptr<DvsSimulator> make_dvs_simulator(const LumaFormat& format);

}  // namespace eventcamera
