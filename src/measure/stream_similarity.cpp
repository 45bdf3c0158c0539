// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/measure/stream_similarity.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

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

namespace {

/// Correlation of two whole recordings from the correlation of two halves (Spearman-Brown).
double spearman_brown(double halves) {
  return 2 * std::max(halves, 0.0) / (1 + std::abs(halves));
}

}  // namespace

CeilingFigures NoiseCeiling::figures() const {
  const auto halves = halves_.figures();
  CeilingFigures ceiling{.rate_correlation = spearman_brown(halves.rate_correlation),
                         .interval_distance = halves.interval_distance,
                         .matches = {}};
  const auto& first = halves.matches[StreamRole::reference];
  const auto& second = halves.matches[StreamRole::candidate];
  for (std::size_t i = 0; i < match_distances.size(); ++i) {
    const double missed = 1 - (first.shares[i] + second.shares[i]) / 2;
    ceiling.matches.shares[i] = 1 - missed * missed;
  }
  ceiling.matches.nearest_distance = (first.nearest_distance + second.nearest_distance) / 4;
  return ceiling;
}

}  // namespace eventcamera
