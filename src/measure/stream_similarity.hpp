// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <random>

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

  /// Sets the start of both streams. Required before the first add().
  void begin(Microseconds start) { rates_ = RateCorrelation(start); }

  /// Adds an event, which must lie inside the sensor and not be earlier than the last one of either
  /// stream.
  void add(StreamRole role, const AbsoluteEvent& event);

  /// Extends both streams to `end`.
  void extend_to(Microseconds end) { rates_.extend_to(end); }

  const EventStatistics& statistics(StreamRole role) const { return statistics_[role]; }
  SimilarityFigures figures() const;

 private:
  PerRole<LastTimes> last_times_;
  PerRole<EventStatistics> statistics_;
  RateCorrelation rates_;
  EventMatcher matcher_;
};

/// How similar a recording would be to another one of the same scene by the same camera.
struct CeilingFigures {
  double rate_correlation = 0;
  double interval_distance = 0;  ///< decades
  MatchFigures matches;
};

/// Estimates how similar a second recording of the same scene could be, from two halves of the
/// first: each event belongs to either half at random.
///
/// The correlation of rates is extrapolated from the halves to the whole by the Spearman-Brown
/// formula, shares of matched events and nearest distances as if twice as many independent events
/// had fired. Real events are more regular than chance, so a good simulator can exceed the ceiling
/// slightly. The map has no ceiling: how much more regular the few events of a pixel are cannot be
/// known from one recording.
class NoiseCeiling {
 public:
  /// Throws std::bad_alloc, as does add().
  NoiseCeiling(int width, int height) : halves_(width, height) {}

  /// As for StreamSimilarity.
  void begin(Microseconds start) { halves_.begin(start); }
  void add(const AbsoluteEvent& event) {
    halves_.add(half_by_chance_() % 2 == 0 ? StreamRole::reference : StreamRole::candidate, event);
  }
  void extend_to(Microseconds end) { halves_.extend_to(end); }

  CeilingFigures figures() const;

 private:
  StreamSimilarity halves_;
  std::mt19937 half_by_chance_;  // the same for each run
};

}  // namespace eventcamera
