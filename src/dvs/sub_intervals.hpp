// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "src/dvs/dvs_settings.hpp"

namespace eventcamera {

/// A common rise of all signals, or fall if `rise` is negative.
struct PulseEdge {
  static constexpr double duration = 100;  ///< microseconds

  double begin;  ///< microseconds after the start of the interval
  double rise;   ///< units of the response
};

/// Cross-talk in cameras whose pixels output both frames and events, such as the DAVIS: when an
/// exposure begins, all signals rise a little and fall again. All over the array, pixels close to
/// an ON event fire at once, and hardly any fire during the pulse. The durations are from the
/// recording slider-depth of a DAVIS240C (docs/realism.md).
class ExposurePulse {
 public:
  static constexpr double plateau = 800;  ///< from one edge to the other, microseconds

  /// Returns the edges within the next interval, in time order. `is_exposed` is true if the
  /// interval ends with a frame, whose exposure began settings.exposure_lead earlier. A pulse that
  /// does not end within the interval ends in the next one; an exposure that began before the
  /// interval, or during another pulse, has no pulse.
  const std::vector<PulseEdge>& next(const DvsSettings& settings, double duration, bool is_exposed);

  /// Aborts the current pulse.
  void reset() { height_ = 0; }

 private:
  std::vector<PulseEdge> edges_;
  double height_ = 0;    ///< of the current pulse, or 0
  double falls_in_ = 0;  ///< microseconds from the start of the next interval
};

/// Part of an interval in which the light of each pixel, and the pulses added to all signals,
/// change linearly.
struct SubInterval {
  double begin;          ///< microseconds after the start of the interval
  double duration;       ///< microseconds
  int step;              ///< 1 ... steps; the light moves towards its value at the end of this step
  double share;          ///< fraction of the remaining change that is made
  double rise;           ///< rise of all signals, units of the response
  std::uint64_t number;  ///< counted from the first frame
};

/// Divides an interval into equal steps, and splits these where pulse edges begin and end.
/// Sub-intervals are numbered from `number` on.
void divide_interval(double duration, int steps, std::span<const PulseEdge> edges,
                     std::uint64_t number, std::vector<SubInterval>& sub_intervals);

}  // namespace eventcamera
