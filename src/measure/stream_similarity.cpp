// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/measure/stream_similarity.hpp"

namespace eventcamera {

StreamSimilarity::StreamSimilarity(int width, int height)
    : last_times_(LastTimes(width, height), LastTimes(width, height)),
      statistics_(EventStatistics(width, height), EventStatistics(width, height)),
      matcher_(width, height) {}

void StreamSimilarity::add(StreamRole role, const AbsoluteEvent& event) {
  statistics_[role].add(event, last_times_[role].take(event));
  rates_.add(role, event.t);
  matcher_.add(role, event);
}

SimilarityFigures StreamSimilarity::figures() const {
  const auto& reference = statistics_[StreamRole::reference];
  const auto& candidate = statistics_[StreamRole::candidate];
  return {.map_correlation = correlation(reference.map(), candidate.map()),
          .rate_correlation = rates_.value(),
          .interval_distance = reference.intervals().distance_to(candidate.intervals()),
          .matches = {matcher_.figures(StreamRole::reference),
                      matcher_.figures(StreamRole::candidate)}};
}

}  // namespace eventcamera
