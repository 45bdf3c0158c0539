// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/event.hpp"

namespace eventcamera {

/// Time in 30 bits: microseconds after an epoch that moves; 0 = never. Stamps are compared by their
/// age, now - stamp, which is exact below max_stamp_age; older ones, and never, are at least that.
using Stamp = std::uint32_t;

inline constexpr int stamp_bits = 30;

/// 9 minutes.
inline constexpr Stamp max_stamp_age = Stamp{1} << (stamp_bits - 1);

/// Longest time that filters can compare ages with.
inline constexpr Nanoseconds max_filter_time = 500'000'000'000;
static_assert(max_filter_time / 1000 < Microseconds{max_stamp_age});

/// Microseconds of a time of at most max_filter_time, rounded up.
constexpr Stamp in_stamps(Nanoseconds time) {
  return static_cast<Stamp>((time + 999) / 1000);
}

/// A stamp after the epoch moves by `amount`.
constexpr Stamp lowered(Stamp stamp, std::uint64_t amount) {
  return stamp > amount ? static_cast<Stamp>(stamp - amount) : 0;
}

/// Stamps the times of one stream.
class StampClock {
 public:
  /// Returns the stamp of `time`, at least max_stamp_age. Calls lower(amount) first if the epoch
  /// moves, for the owner of stamps to lower them all.
  template <class Lower>
  Stamp at(Microseconds time, const Lower& lower) {
    const auto stamp = static_cast<std::uint64_t>(time) - static_cast<std::uint64_t>(epoch_);
    if (stamp < std::uint64_t{1} << stamp_bits) [[likely]]
      return static_cast<Stamp>(stamp);
    epoch_ = time - Microseconds{max_stamp_age};
    lower(stamp - max_stamp_age);
    return max_stamp_age;
  }

 private:
  Microseconds epoch_ = -(Microseconds{1} << 62);  ///< the first time lowers all stamps to never
};

}  // namespace eventcamera
