// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "src/dvs/dvs_settings.hpp"

namespace eventcamera {

/// All signals rise, or fall if `rise` is negative.
struct PulseEdge {
  static constexpr double duration = 100;  ///< microseconds

  double begin;  ///< microseconds after the start of the interval
  double rise;   ///< units of the response
};

/// Cameras whose pixels give both frames and events, such as the DAVIS, couple the one into the
/// other: when an exposure begins, all signals rise a little and fall again. Pixels that were about
/// to fire ON do so at once, all over the array, and hardly any fires during the pulse. Seen in the
/// recording slider-depth of a DAVIS240C (docs/realism.md), the source of the durations.
class ExposurePulse {
 public:
  static constexpr double plateau = 800;  ///< from one edge to the other, microseconds

  /// Returns the edges within the next interval, in order of time. `is_exposed` tells whether the
  /// interval ends with a frame, whose exposure began settings.exposure_lead earlier. A pulse that
  /// does not end within the interval ends in the next one; an exposure that began before the
  /// interval, or during another pulse, has none.
  const std::vector<PulseEdge>& next(const DvsSettings& settings, double duration, bool is_exposed);

  /// No pulse is under way.
  void reset() { height_ = 0; }

 private:
  std::vector<PulseEdge> edges_;
  double height_ = 0;    ///< of the pulse under way, or 0
  double falls_in_ = 0;  ///< microseconds from the start of the next interval
};

/// A part of an interval in which the light of each pixel changes on a straight line, and so does
/// what pulses add to all signals.
struct SubInterval {
  double begin;          ///< microseconds after the start of the interval
  double duration;       ///< microseconds
  int step;              ///< of the interval's equal steps, 1 ...; the light moves towards its end
  double share;          ///< of the remaining way there
  double rise;           ///< of all signals, units of the response
  std::uint64_t number;  ///< counted from the first frame on
};

/// Divides an interval into equal steps, and these where the edges of pulses begin and end. The
/// sub-intervals are numbered from `number` on.
void divide_interval(double duration, int steps, std::span<const PulseEdge> edges,
                     std::uint64_t number, std::vector<SubInterval>& sub_intervals);

}  // namespace eventcamera
