// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "src/core/absolute_event.hpp"

namespace eventcamera {

/// A queue of events in a ring that grows as it must, up to so many.
class RecentEvents {
 public:
  static constexpr std::size_t max_size = std::size_t{1} << 23;

  bool empty() const { return size_ == 0; }
  bool full() const { return size_ == max_size; }
  std::size_t size() const { return size_; }
  const AbsoluteEvent& front() const { return ring_[first_]; }

  /// Not where full(). Throws std::bad_alloc.
  void push(const AbsoluteEvent& event) {
    if (size_ == ring_.size()) grow();
    ring_[(first_ + size_) & (ring_.size() - 1)] = event;
    ++size_;
  }

  void pop() {
    first_ = (first_ + 1) & (ring_.size() - 1);
    --size_;
  }

 private:
  /// To a power of two, so that a place in the ring is a matter of bits.
  void grow() {
    std::vector<AbsoluteEvent> larger(ring_.empty() ? 1024 : 2 * ring_.size());
    for (std::size_t i = 0; i < size_; ++i) larger[i] = ring_[(first_ + i) & (ring_.size() - 1)];
    ring_.swap(larger);
    first_ = 0;
  }

  std::vector<AbsoluteEvent> ring_;
  std::size_t first_ = 0;
  std::size_t size_ = 0;
};

}  // namespace eventcamera
