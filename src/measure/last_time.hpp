// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/event.hpp"

namespace eventcamera {

/// Time of the last event of a pixel, or none, which is before all others. None is all zeros, so
/// that memory for pixels without events need not be written.
class LastTime {
 public:
  constexpr LastTime() = default;
  constexpr LastTime(Microseconds t) : bits_(static_cast<std::uint64_t>(t) ^ sign) {}

  constexpr bool is_known() const { return bits_ != 0; }
  constexpr Microseconds value() const { return static_cast<Microseconds>(bits_ ^ sign); }

  friend constexpr bool operator==(LastTime a, LastTime b) { return a.bits_ == b.bits_; }
  friend constexpr bool operator<(LastTime a, LastTime b) { return a.bits_ < b.bits_; }

 private:
  static constexpr std::uint64_t sign = std::uint64_t{1} << 63;

  std::uint64_t bits_ = 0;
};

}  // namespace eventcamera
