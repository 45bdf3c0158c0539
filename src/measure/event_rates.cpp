// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/measure/event_rates.hpp"

#include <algorithm>
#include <cmath>

namespace eventcamera {

void RateCurve::extend_to(Microseconds end) {
  if (end <= covered_) return;
  while (bin_of(end - 1) >= max_bins) join_bins();
  bins_.resize(std::max(bins_.size(), bin_of(end - 1) + 1));
  covered_ = start_ + length_ * static_cast<Microseconds>(bins_.size());
}

void RateCurve::join_bins() {
  const std::size_t joined = (bins_.size() + 1) / 2;
  bins_.resize(2 * joined);
  for (std::size_t i = 0; i < joined; ++i)
    for (const auto role : both_roles) bins_[i][role] = bins_[2 * i][role] + bins_[2 * i + 1][role];
  bins_.resize(joined);
  length_ *= 2;
}

void RateCorrelation::extend_to(Microseconds end) {
  constexpr Microseconds length = 1000;
  if (end <= end_) return;
  const Microseconds bins = (end - end_ + length - 1) / length;
  if (has_bin_) add_bin(sums_, last_);
  sums_.bins += static_cast<double>(bins - 1);
  last_ = {};
  has_bin_ = true;
  end_ += bins * length;
}

void RateCorrelation::add_bin(Sums& sums, const PerRole<double>& bin) {
  ++sums.bins;
  sums.product += bin[StreamRole::reference] * bin[StreamRole::candidate];
  for (const auto role : both_roles) {
    sums.counts[role] += bin[role];
    sums.squares[role] += bin[role] * bin[role];
  }
}

double RateCorrelation::value() const {
  auto sums = sums_;
  if (has_bin_) add_bin(sums, last_);
  const double reference = sums.counts[StreamRole::reference];
  const double candidate = sums.counts[StreamRole::candidate];
  const double variances =
      (sums.bins * sums.squares[StreamRole::reference] - reference * reference) *
      (sums.bins * sums.squares[StreamRole::candidate] - candidate * candidate);
  if (!(variances > 0)) return 0;
  return (sums.bins * sums.product - reference * candidate) / std::sqrt(variances);
}

}  // namespace eventcamera
