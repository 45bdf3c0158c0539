// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "src/dvs/dvs_settings.hpp"

namespace eventcamera {

/// All signals rise, or fall where `rise` is negative.
struct PulseEdge {
  static constexpr double duration = 100;  ///< microseconds

  double begin;  ///< microseconds after the start of the interval
  double rise;   ///< units of the response
};

/// Cameras whose pixels give both frames and events, as the DAVIS does, couple the one into the
/// other: as an exposure begins all signals rise a little, and fall again. Pixels that were about
/// to fire ON do so at once, all over the picture, and hardly any does meanwhile. Seen in the
/// recording slider-depth of a DAVIS240C (docs/realism.md), whence the durations.
class ExposurePulse {
 public:
  static constexpr double plateau = 800;  ///< from one edge to the other, microseconds

  /// The edges within the next interval, in the order of time. `is_exposed` tells whether it ends
  /// with a frame, whose exposure began settings.exposure_lead before that. A pulse that does not
  /// end within the interval ends in the next one; an exposure that began before the interval, or
  /// in the midst of another pulse, has none.
  const std::vector<PulseEdge>& next(const DvsSettings& settings, double duration, bool is_exposed);

  /// No pulse is under way.
  void reset() { height_ = 0; }

 private:
  std::vector<PulseEdge> edges_;
  double height_ = 0;    ///< of the pulse under way, or 0
  double falls_in_ = 0;  ///< microseconds from the start of the next interval
};

}  // namespace eventcamera
