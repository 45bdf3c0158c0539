// SPDX-License-Identifier: LGPL-2.1-or-later
// Shared by encoders of binary formats.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "src/core/event.hpp"

namespace eventcamera {

/// Appends little-endian words to a byte vector.
template <class Word>
class WordWriter {
 public:
  explicit WordWriter(std::vector<std::uint8_t>& out) : out_(out), used_(out.size()) {}
  ~WordWriter() { out_.resize(used_); }
  WordWriter(const WordWriter&) = delete;
  WordWriter& operator=(const WordWriter&) = delete;

  /// Must be called before put(), with the maximum number of words that may follow.
  void reserve(std::size_t words) {
    const auto needed = used_ + words * sizeof(Word);
    if (needed > out_.size()) out_.resize(needed);
  }

  void put(Word word) {
    std::memcpy(out_.data() + used_, &word, sizeof word);
    used_ += sizeof word;
  }

  /// Size of the byte vector with all words so far.
  std::size_t size() const { return used_; }

 private:
  std::vector<std::uint8_t>& out_;
  std::size_t used_;
};

/// Number of events for which space is reserved at once.
constexpr std::size_t events_at_once = 2048;

/// Encodes events with `write(few, words)`, after reserving space for `words_at_once` words each
/// time.
template <class Word, class Write>
void write_events(std::span<const AbsoluteEvent> events, std::size_t words_at_once,
                  std::vector<std::uint8_t>& out, const Write& write) {
  WordWriter<Word> words(out);
  while (!events.empty()) {
    const auto few = events.first(std::min(events.size(), events_at_once));
    events = events.subspan(few.size());
    words.reserve(words_at_once);
    write(few, words);
  }
}

/// Limits pauses for formats that fill them with words: removes pauses of more than half a day,
/// also before the first event, so that a stray time, or one since 1970, does not fill the disk.
class GapLimiter {
 public:
  static constexpr Microseconds max_gap = Microseconds{12} * 3600 * 1'000'000;

  /// Must be called at least for every event after a long pause.
  void advance_to(Microseconds t) {
    const auto gap = static_cast<std::uint64_t>(t) - static_cast<std::uint64_t>(last_);
    if (t > last_ && gap > static_cast<std::uint64_t>(max_gap)) {
      shift_ += gap;
      if (begun_) removed_ += gap;
    }
    begun_ = true;
    last_ = t;
  }

  /// Skips events without a long pause among them.
  void pass(std::span<const AbsoluteEvent> events) {
    if (!events.empty()) last_ = events.back().t;
  }

  /// Returns the time to write; unsigned, because overflow must be well-defined.
  std::uint64_t written(Microseconds t) const { return static_cast<std::uint64_t>(t) - shift_; }

  std::uint64_t removed_time() const { return removed_; }

 private:
  Microseconds last_ = 0;
  std::uint64_t shift_ = 0;
  std::uint64_t removed_ = 0;  ///< removed after the first event
  bool begun_ = false;
};

}  // namespace eventcamera
