// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <random>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/event_validator.hpp"
#include "src/core/label.hpp"
#include "src/measure/cause_counts.hpp"
#include "src/measure/event_matcher.hpp"
#include "src/measure/event_rates.hpp"
#include "src/measure/event_statistics.hpp"
#include "src/measure/stream_role.hpp"

namespace eventcamera {

struct SimilarityFigures {
  double map_correlation = 0;    ///< correlation of the event counts per pixel
  double rate_correlation = 0;   ///< correlation of the event counts per millisecond
  double interval_distance = 0;  ///< between the inter-event intervals, decades
  PerRole<MatchFigures> matches;
};

/// Measures the similarity of two streams of the same sensor, whose events are added in order of
/// time.
class StreamSimilarity {
 public:
  StreamSimilarity(int width, int height);

  /// Sets the start of both streams. Required before the first add().
  void begin(Microseconds start) { rates_ = RateCorrelation(start); }

  /// Adds an event, which must lie inside the sensor and not be earlier than the last one of either
  /// stream.
  void add(StreamRole role, const AbsoluteEvent& event);

  void extend_to(Microseconds end) { rates_.extend_to(end); }

  const EventStatistics& statistics(StreamRole role) const { return statistics_[role]; }
  SimilarityFigures figures() const;

 private:
  PerRole<LastTimes> last_times_;
  PerRole<EventStatistics> statistics_;
  RateCorrelation rates_;
  EventMatcher matcher_;
};

/// Similarity of two recordings of the same scene by the same camera.
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
/// slightly. The map has no ceiling: one recording does not show how regular the few events of a
/// pixel are.
class NoiseCeiling {
 public:
  NoiseCeiling(int width, int height) : halves_(width, height) {}

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

/// Figures of two streams over the time that both cover.
struct ComparisonFigures {
  Nanoseconds start = 0;  ///< start of the time covered by both streams
  Nanoseconds end = 0;
  PerRole<StreamFigures> streams;
  SimilarityFigures similarity;
  CeilingFigures ceiling;  ///< of the reference
};

/// Compares two streams of the same sensor over the time that both cover.
class StreamComparison {
 public:
  StreamComparison(int width, int height);

  /// The stream that lags behind; its events are needed next.
  StreamRole behind() const;

  /// End of the data added to a stream; none before the first.
  std::optional<Nanoseconds> end_of(StreamRole role) const;

  /// Adds the sorted events of [start, end] of one stream, with times relative to `base`, and their
  /// labels, if they have any. Returns the numbers of skipped events.
  InvalidEvents add(StreamRole role, std::span<const Event> events, Microseconds base,
                    Nanoseconds start, Nanoseconds end, std::span<const Label> labels = {});

  ComparisonFigures figures() const;
  const EventMap& map(StreamRole role) const { return similarity_.statistics(role).map(); }
  const RateCurve& rates() const { return rates_; }
  /// Causes of the events in the time that both streams cover; none if they are not labelled.
  const CauseCounts& causes(StreamRole role) const { return causes_[role]; }

 private:
  struct Arriving {
    EventValidator validator;
    std::vector<AbsoluteEvent> waiting{};  ///< events waiting for the other stream
    std::size_t processed = 0;  ///< number of events at the front of `waiting` already processed
    bool is_labelled = false;
    std::optional<Nanoseconds> start{};
    Nanoseconds end = 0;
  };

  /// Start of the time covered by both streams; none if they do not overlap yet.
  std::optional<Nanoseconds> start() const;
  Nanoseconds end() const;
  /// Processes the waiting events of both streams up to `end`, in order of time.
  void move_until(Microseconds end);

  PerRole<Arriving> arriving_;
  StreamSimilarity similarity_;
  NoiseCeiling ceiling_;
  RateCurve rates_;
  PerRole<CauseCounts> causes_;
  bool begun_ = false;
};

}  // namespace eventcamera
