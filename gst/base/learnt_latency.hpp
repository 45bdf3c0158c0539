// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <deque>
#include <optional>

#include "src/core/event.hpp"

/// A latency learnt from measured delays. It rises to the second largest of the recent delays: one
/// alone, such as a pause of the source, does not delay all that follows. It falls once all recent
/// delays are clearly smaller.
class LearntLatency {
 public:
  using Nanoseconds = eventcamera::Nanoseconds;

  /// What is known without measuring; the latency does not fall below it.
  void expect(Nanoseconds expected) {
    if (expected_ == expected) return;
    recent_.clear();
    expected_ = expected;
    value_ = expected;
  }

  /// A delay that ended at `time`, of the stream.
  void add(Nanoseconds time, Nanoseconds delay) {
    if (!recent_.empty() && time < recent_.back().end) recent_.clear();
    recent_.push_back({time, delay});
    while (recent_.size() > max_count ||
           (recent_.size() > min_count && recent_.front().end < time - window))
      recent_.pop_front();
    learn();
  }

  Nanoseconds value() const { return value_; }

 private:
  struct Delay {
    Nanoseconds end;
    Nanoseconds length;
  };

  // How far back recent delays reach.
  static constexpr Nanoseconds window = 500'000'000;
  static constexpr std::size_t min_count = 3;
  static constexpr std::size_t max_count = 100;

  void learn() {
    Nanoseconds largest = 0;
    Nanoseconds second = 0;
    for (const auto& delay : recent_) {
      second = std::max(second, std::min(largest, delay.length));
      largest = std::max(largest, delay.length);
    }
    if (!expected_ && recent_.size() == 1) second = largest;
    if (second > value_)
      value_ = second;
    else if (largest < value_ / 4 * 3)
      value_ = std::max(largest, expected_.value_or(0));
  }

  std::deque<Delay> recent_;
  std::optional<Nanoseconds> expected_;
  Nanoseconds value_ = 0;
};
