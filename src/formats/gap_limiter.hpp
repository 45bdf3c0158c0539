// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/event.hpp"

namespace eventcamera {

/// Times for formats that write silence out: a pause of more than half a day, also before the first
/// event, is left out. So a stray time, or one since 1970, does not fill the disk.
class GapLimiter {
 public:
  static constexpr Microseconds longest = Microseconds{12} * 3600 * 1'000'000;

  /// Call it for an event at least wherever a pause may be that long.
  void reach(Microseconds t) {
    const auto pause = static_cast<std::uint64_t>(t) - static_cast<std::uint64_t>(last_);
    if (t > last_ && pause > static_cast<std::uint64_t>(longest)) left_out_ += pause;
    last_ = t;
  }

  /// The time to write. Unsigned, so that no time makes it overflow.
  std::uint64_t written(Microseconds t) const { return static_cast<std::uint64_t>(t) - left_out_; }

 private:
  Microseconds last_ = 0;
  std::uint64_t left_out_ = 0;
};

}  // namespace eventcamera
