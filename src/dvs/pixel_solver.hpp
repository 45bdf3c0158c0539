// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/dvs/course.hpp"
#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/event_collector.hpp"
#include "src/dvs/pixel_array.hpp"
#include "src/dvs/random.hpp"
#include "src/dvs/row_filter.hpp"

namespace eventcamera {

/// A pixel makes at most so many events in one segment, those that its refractory period swallows
/// included; then it is taken to be where its signal is. White after black is 35 events at common
/// thresholds.
inline constexpr int max_events = 512;

/// A stretch of time in which the light goes on a straight line in each pixel.
struct Segment {
  double begin;          ///< microseconds after the start of the interval
  double duration;       ///< microseconds
  std::uint64_t number;  ///< of all since the first frame
  double rise = 0;       ///< of all signals besides, units of the response
};

/// Takes pixels through segments one by one, exactly: crossings of the thresholds, leak counted
/// in, shot noise, the refractory period, latency.
class PixelTime {
 public:
  PixelTime(const DvsSettings& settings, const Random& random, const Segment& segment);

  /// Moves the reference, rest and quiet of a row's candidates to the end of the segment.
  void pass(PixelArray& pixels, int y, const Candidates& candidates, const ShadeTables& tables,
            EventCollector& events) const;

 private:
  const DvsSettings& settings_;
  const Random& random_;
  const Segment& segment_;
  bool is_plain_;  ///< but for noise, an event is a crossing and nothing more
};

}  // namespace eventcamera
