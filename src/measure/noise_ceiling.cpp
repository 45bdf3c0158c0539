// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/measure/noise_ceiling.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace eventcamera {
namespace {

/// Correlation of two wholes, from the correlation of two halves.
double spearman_brown(double halves) {
  return 2 * std::max(halves, 0.0) / (1 + std::abs(halves));
}

}  // namespace

CeilingFigures NoiseCeiling::figures() const {
  const auto halves = halves_.figures();
  CeilingFigures ceiling{.map_correlation = spearman_brown(halves.map_correlation),
                         .rate_correlation = spearman_brown(halves.rate_correlation),
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
