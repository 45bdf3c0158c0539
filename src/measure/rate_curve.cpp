// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/measure/rate_curve.hpp"

#include <algorithm>

namespace eventcamera {

void RateCurve::extend_to(Microseconds end) {
  if (end <= covered_) return;
  while (bin_of(end) >= max_bins) join_bins();
  bins_.resize(std::max(bins_.size(), bin_of(end) + 1));
  covered_ = start_ + length_ * static_cast<Microseconds>(bins_.size());
}

void RateCurve::join_bins() {
  const std::size_t joined = (bins_.size() + 1) / 2;
  bins_.resize(2 * joined);
  for (std::size_t i = 0; i < joined; ++i)
    for (const auto side : both_sides) bins_[i][side] = bins_[2 * i][side] + bins_[2 * i + 1][side];
  bins_.resize(joined);
  length_ *= 2;
}

}  // namespace eventcamera
