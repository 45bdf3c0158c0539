// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "src/core/absolute_event.hpp"

namespace eventcamera {

/// How long gaps are, in bins that grow with them: to the microsecond up to 63 of them, and to
/// 1/32 of the gap beyond.
class GapHistogram {
 public:
  /// A gap of 0 or more.
  void add(Microseconds gap) {
    ++bins_[bin_of(static_cast<std::uint64_t>(gap))];
    ++count_;
  }

  std::uint64_t count() const { return count_; }

  /// What so great a share of the gaps do not exceed, to the middle of its bin; 0 where there are
  /// none. `share` in [0, 1].
  Microseconds quantile(double share) const;

  void clear() { *this = {}; }

 private:
  static constexpr unsigned step_bits = 5;  ///< of the bins of an octave
  static constexpr std::uint64_t steps = 1U << step_bits;
  static constexpr std::uint64_t exact = 2 * steps;  ///< gaps below have a bin each

  static constexpr std::size_t bin_of(std::uint64_t gap) {
    if (gap < exact) return gap;
    const auto shift = static_cast<unsigned>(std::bit_width(gap)) - step_bits - 1;
    return steps * shift + (gap >> shift);
  }
  static constexpr Microseconds middle_of(std::size_t bin) {
    if (bin < exact) return static_cast<Microseconds>(bin);
    const auto shift = static_cast<unsigned>(bin / steps) - 1;
    const std::uint64_t first = (bin - steps * shift) << shift;
    return static_cast<Microseconds>(first + (std::uint64_t{1} << shift) / 2);
  }
  static constexpr std::size_t bin_count = steps * (63 - step_bits - 1) + exact;  ///< up to 63 bits

  std::array<std::uint64_t, bin_count> bins_{};
  std::uint64_t count_ = 0;
};

}  // namespace eventcamera
