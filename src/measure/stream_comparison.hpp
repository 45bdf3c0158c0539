// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/event_validator.hpp"
#include "src/core/label.hpp"
#include "src/measure/cause_counts.hpp"
#include "src/measure/event_rates.hpp"
#include "src/measure/event_statistics.hpp"
#include "src/measure/stream_role.hpp"
#include "src/measure/stream_similarity.hpp"

namespace eventcamera {

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
  /// Throws std::bad_alloc, as does add().
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
    std::size_t taken = 0;  ///< number of events at the front of `waiting` already processed
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
