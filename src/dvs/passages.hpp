// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>
#include <vector>

#include "src/dvs/exposure_pulse.hpp"

namespace eventcamera {

/// A stretch of an interval in which the light of each pixel goes on a straight line, and all
/// signals beside it on another.
struct Passage {
  double begin;     ///< microseconds after the start of the interval
  double duration;  ///< microseconds
  int step;         ///< of the interval's equal steps, 1 ...: the light goes to where that one ends
  double share;     ///< of what is left of the way there
  double rise;      ///< of all signals, units of the response
};

/// Cuts an interval into equal steps, and these where the edges of pulses begin and end.
void cut_into_passages(double duration, int steps, std::span<const PulseEdge> edges,
                       std::vector<Passage>& passages);

}  // namespace eventcamera
