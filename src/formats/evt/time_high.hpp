// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/formats/unit_reader.hpp"

namespace eventcamera {

/// The clock that TIME_HIGH words drive: they carry `bits` of a count of 2^`shift` microseconds.
///
/// A count that falls has wrapped if it falls by more than half its range. Less is an error, as
/// sensors make them: single bits of these words flip. Then the clock goes back, and the next sound
/// word puts it right.
template <int bits, int shift>
class TimeHigh {
 public:
  bool known() const { return known_; }
  std::uint32_t count() const { return count_; }

  /// In microseconds; unsigned, so that no file can make it overflow.
  std::uint64_t time() const { return laps_ + (std::uint64_t{count_} << shift); }

  void follow(std::uint32_t count) {
    constexpr auto half = std::uint32_t{1} << (bits - 1);
    if (known_ && count < count_ && count_ - count > half)
      laps_ += std::uint64_t{1} << (bits + shift);
    count_ = count;
    known_ = true;
  }

  UnitReader::State state() const {
    return {static_cast<Microseconds>(time()), static_cast<std::uint64_t>(known_)};
  }

  void restore(Microseconds clock, bool known) {
    const auto time = static_cast<std::uint64_t>(clock);
    count_ = static_cast<std::uint32_t>(time >> shift) & mask;
    laps_ = time - (std::uint64_t{count_} << shift);
    known_ = known;
  }

 private:
  static constexpr std::uint32_t mask = (std::uint32_t{1} << bits) - 1;

  std::uint64_t laps_ = 0;
  std::uint32_t count_ = 0;
  bool known_ = false;
};

}  // namespace eventcamera
