// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/event.hpp"

namespace eventcamera {

/// Unwraps timestamps of `bits` bits, in microseconds. A decrease by more than half their range is
/// a wrap; a smaller one is disorder. So is, after a wrap, an increase by more than max_rise: an
/// event of the second before the wrap.
template <int bits>
class UnwrappedClock {
 public:
  static constexpr std::uint64_t range = std::uint64_t{1} << bits;
  static constexpr std::uint64_t max_rise = range - 1'000'001;

  Microseconds follow(std::uint32_t timestamp) {
    const auto last = static_cast<std::uint32_t>(time_ % range);
    const bool wrapped = timestamp < last && last - timestamp > range / 2;
    const bool precedes_wrap = timestamp > last && timestamp - last > max_rise && time_ >= range;
    // Unsigned, because overflow must be well-defined for any file.
    time_ += std::uint64_t{timestamp} - last + (std::uint64_t{wrapped} << bits) -
             (std::uint64_t{precedes_wrap} << bits);
    return time();
  }

  Microseconds time() const { return static_cast<Microseconds>(time_); }
  void restore(Microseconds time) { time_ = static_cast<std::uint64_t>(time); }

 private:
  std::uint64_t time_ = 0;
};

}  // namespace eventcamera
