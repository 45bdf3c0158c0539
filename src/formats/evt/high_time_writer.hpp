// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/formats/gap_limiter.hpp"
#include "src/formats/word_writer.hpp"

namespace eventcamera {

/// When to write which TIME_HIGH in EVT2, EVT2.1 and EVT4: they count 64 microseconds in 28 bits.
class HighTimeWriter {
 public:
  std::uint64_t written(Microseconds t) const { return silence_.written(t); }

  /// Whether an event at `t` needs a TIME_HIGH before it.
  bool is_new(Microseconds t) const { return written(t) >> 6 != count_; }

  /// Writes it. `room`: how many words the caller may write then without a reserve().
  template <class Word, class Make>
  void reach(Microseconds t, WordWriter<Word>& words, std::size_t room, const Make& make) {
    silence_.reach(t);
    const auto count = written(t) >> 6;
    const auto laps = (count >> bits) - (count_ == none ? 0 : count_ >> bits);
    if (laps != 0 && laps <= max_laps) {
      // Readers know a wrap by the fall from nearly the largest count to nearly zero (OpenEB allows
      // 10 ms), so each is written out.
      words.reserve(2 * laps + 1 + room);
      for (std::uint64_t i = 0; i < laps; ++i) {
        words.put(make((std::uint64_t{1} << bits) - 1));
        words.put(make(0));
      }
    }
    words.put(make(count));
    count_ = count;
  }

 private:
  static constexpr int bits = 28;
  static constexpr std::uint64_t max_laps = (GapLimiter::longest >> (bits + 6)) + 1;
  static constexpr std::uint64_t none = ~std::uint64_t{0};

  GapLimiter silence_;
  std::uint64_t count_ = none;
};

}  // namespace eventcamera
