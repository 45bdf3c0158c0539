// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <deque>
#include <optional>

#include "src/core/event.hpp"

namespace eventcamera {

/// Latency learnt from measured delays. It rises to the second largest of the recent delays, so
/// that a single one, such as a pause of the source, does not delay everything after it. It falls
/// once all recent delays are clearly smaller. Jitter does not change it.
class LearntLatency {
 public:
  /// Sets the latency known without measurement, which is the minimum.
  void expect(Nanoseconds expected) {
    if (expected_ == expected) return;
    recent_.clear();
    expected_ = expected;
    value_ = expected;
  }

  /// Adds a delay that ended at stream time `time`.
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

  // Maximum age of recent delays.
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
    if (second > value_ + value_ / 8)
      value_ = second;
    else if (largest < value_ / 4 * 3)
      value_ = std::max(largest, expected_.value_or(0));
  }

  std::deque<Delay> recent_;
  std::optional<Nanoseconds> expected_;
  Nanoseconds value_ = 0;
};

}  // namespace eventcamera
