// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/core/event.hpp"
#include "src/measure/event_matcher.hpp"
#include "src/measure/event_rates.hpp"
#include "src/measure/event_statistics.hpp"
#include "src/measure/stream_role.hpp"

namespace eventcamera {

/// How similar two streams are.
struct SimilarityFigures {
  double map_correlation = 0;    ///< correlation of the event counts per pixel
  double rate_correlation = 0;   ///< correlation of the event counts per millisecond
  double interval_distance = 0;  ///< between the inter-event intervals, decades
  PerRole<MatchFigures> matches;
};

/// Measures how similar two streams of the same sensor are, as their events come in order of time.
class StreamSimilarity {
 public:
  /// Throws std::bad_alloc, as does add().
  StreamSimilarity(int width, int height);

  /// Says when both streams start. Required before the first add().
  void begin(Microseconds start) { rates_ = RateCorrelation(start); }

  /// Adds an event, which must lie inside the sensor and not be earlier than the last one of either
  /// stream.
  void add(StreamRole role, const AbsoluteEvent& event);

  /// Says that both streams last until `end`.
  void extend_to(Microseconds end) { rates_.extend_to(end); }

  const EventStatistics& statistics(StreamRole role) const { return statistics_[role]; }
  SimilarityFigures figures() const;

 private:
  PerRole<LastTimes> last_times_;
  PerRole<EventStatistics> statistics_;
  RateCorrelation rates_;
  EventMatcher matcher_;
};

}  // namespace eventcamera
