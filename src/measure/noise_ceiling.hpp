// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <random>

#include "src/core/event.hpp"
#include "src/measure/stream_similarity.hpp"

namespace eventcamera {

/// How similar a recording would be to another one of the same scene by the same camera.
struct CeilingFigures {
  double map_correlation = 0;
  double rate_correlation = 0;
  double interval_distance = 0;  ///< decades
  MatchFigures matches;
};

/// Estimates how similar a second recording of the same scene could be, from two halves of the
/// first: each event belongs to either half at random.
///
/// Correlations of the halves become those of the whole by the Spearman-Brown formula; the share of
/// events with a match, and the distance to the nearest, as if twice as many events had come
/// independently. A camera's events are more regular than chance, so that a good simulator can come
/// out slightly above.
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
