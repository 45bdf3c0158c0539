// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "src/core/event.hpp"

namespace eventcamera {

/// Appends little-endian words to bytes.
template <class Word>
class WordWriter {
 public:
  explicit WordWriter(std::vector<std::uint8_t>& out) : out_(out), used_(out.size()) {}
  ~WordWriter() { out_.resize(used_); }
  WordWriter(const WordWriter&) = delete;
  WordWriter& operator=(const WordWriter&) = delete;

  /// Before every put(): how many will follow at the most.
  void reserve(std::size_t words) {
    const auto needed = used_ + words * sizeof(Word);
    if (needed > out_.size()) out_.resize(needed);
  }

  void put(Word word) {
    std::memcpy(out_.data() + used_, &word, sizeof word);
    used_ += sizeof word;
  }

 private:
  std::vector<std::uint8_t>& out_;
  std::size_t used_;
};

/// Room is made for so many events at once.
constexpr std::size_t events_at_once = 2048;

/// Encodes events by `write(few, words)`, which finds room for `words_at_once`.
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

}  // namespace eventcamera
