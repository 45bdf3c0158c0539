// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>

namespace eventcamera {

/// Tracks 31-bit sequence numbers, like RFC 3550: a jump is accepted only once the next number
/// confirms it, so a stray datagram neither disturbs the stream nor counts as loss.
class SequenceTracker {
 public:
  enum class Verdict : std::uint8_t { next, late, stray, restarted };
  struct Result {
    Verdict verdict = Verdict::next;
    std::uint32_t lost = 0;  ///< numbers missing before this one
  };

  Result take(std::uint32_t number) {
    number &= mask;
    const auto ahead = (number - next_.value_or(number)) & mask;
    if (ahead <= max_lost) return accept(number, Verdict::next, ahead);
    if (number == after_stray_) return accept(number, Verdict::restarted, 0);
    if (mask - ahead < max_late) return {Verdict::late};
    after_stray_ = (number + 1) & mask;
    return {Verdict::stray};
  }

 private:
  static constexpr std::uint32_t mask = 0x7fff'ffff;
  static constexpr std::uint32_t max_lost = 1 << 16;
  static constexpr std::uint32_t max_late = 100;

  Result accept(std::uint32_t number, Verdict verdict, std::uint32_t lost) {
    next_ = (number + 1) & mask;
    after_stray_.reset();
    return {verdict, lost};
  }

  std::optional<std::uint32_t> next_;
  std::optional<std::uint32_t> after_stray_;  ///< number that confirms a jump
};

}  // namespace eventcamera
