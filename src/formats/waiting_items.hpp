// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/formats/chunker.hpp"

namespace eventcamera {

/// Later than any item, in any time base.
constexpr Microseconds after_all_items = std::numeric_limits<Microseconds>::max() / 2;

/// Items with a time `t`, such as triggers, that wait for the interval of events they belong to.
template <class Item>
class WaitingItems {
 public:
  /// Drops items at an erroneous time, and returns their number.
  std::size_t push(std::span<const Item> items) {
    const auto before = waiting_.size();
    std::ranges::copy_if(items, std::back_inserter(waiting_), Chunker::is_time, &Item::t);
    return before + items.size() - waiting_.size();
  }

  /// True if too many wait to wait any longer.
  bool is_full() const { return waiting_.size() > max_count; }

  /// Removes and returns the items before `end`, sorted by time. Valid until the next call.
  std::span<Item> pop_before(Microseconds end) {
    popped_.clear();
    if (waiting_.empty()) return popped_;
    std::ranges::stable_sort(waiting_, {}, &Item::t);
    const auto last = std::ranges::lower_bound(waiting_, end, {}, &Item::t);
    popped_.assign(waiting_.begin(), last);
    waiting_.erase(waiting_.begin(), last);
    return popped_;
  }

  /// Time of the first item that waits.
  std::optional<Microseconds> first() const {
    const auto first = std::ranges::min_element(waiting_, {}, &Item::t);
    return first == waiting_.end() ? std::nullopt : std::optional(first->t);
  }

  void clear() { waiting_.clear(); }

 private:
  static constexpr std::size_t max_count = std::size_t{1} << 16;

  std::vector<Item> waiting_;
  std::vector<Item> popped_;
};

}  // namespace eventcamera
