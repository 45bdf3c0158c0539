// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/formats/unit_reader.hpp"

namespace eventcamera {

/// Unwraps a counter of `bits` bits in units of 2^`shift` microseconds, such as that of TIME_HIGH
/// words.
///
/// A count that falls by more than half its range has wrapped. A smaller fall is a sensor error,
/// such as a flipped bit: the time base then goes back, and the next intact word corrects it.
template <int bits, int shift>
class TimeBase {
 public:
  bool known() const { return known_; }
  std::uint32_t count() const { return count_; }

  /// In microseconds; unsigned, because overflow must be well-defined for any file.
  std::uint64_t time() const { return wraps_ + (std::uint64_t{count_} << shift); }

  void follow(std::uint32_t count) {
    constexpr auto half = std::uint32_t{1} << (bits - 1);
    const bool wrapped = count < count_ && count_ - count > half;
    wraps_ += std::uint64_t{wrapped} << (bits + shift);
    count_ = count;
    known_ = true;
  }

  UnitReader::State state() const {
    return {static_cast<Microseconds>(time()), static_cast<std::uint64_t>(known_)};
  }

  void restore(Microseconds clock, bool known) {
    const auto time = static_cast<std::uint64_t>(clock);
    count_ = static_cast<std::uint32_t>(time >> shift) & mask;
    wraps_ = time - (std::uint64_t{count_} << shift);
    known_ = known;
  }

 private:
  static constexpr std::uint32_t mask = ~std::uint32_t{0} >> (32 - bits);

  std::uint64_t wraps_ = 0;  ///< sum of the wraps so far, in microseconds
  std::uint32_t count_ = 0;
  bool known_ = false;
};

}  // namespace eventcamera
