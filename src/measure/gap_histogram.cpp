// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/measure/gap_histogram.hpp"

#include <algorithm>
#include <cmath>

namespace eventcamera {

Microseconds GapHistogram::quantile(double share) const {
  if (count_ == 0) return 0;
  const auto rank = std::clamp<std::uint64_t>(
      static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count_))), 1, count_);
  std::uint64_t below = 0;
  std::size_t bin = 0;
  while ((below += bins_[bin]) < rank) ++bin;
  return middle_of(bin);
}

}  // namespace eventcamera
