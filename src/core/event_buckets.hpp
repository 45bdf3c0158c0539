// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// The events of one interval as kernels produce them: a bucket for each step and, within a step,
/// for each band of rows. Each thread fills buckets of its own; in order, the buckets are the
/// sorted events of the interval.
class EventBuckets {
 public:
  /// On a cache line of its own: threads fill neighbouring buckets concurrently.
  struct alignas(64) Bucket : std::vector<Event> {};

  /// Empties the buckets and keeps their memory.
  void reset(int steps, int bands) {
    bands_ = static_cast<std::size_t>(bands);
    buckets_.resize(static_cast<std::size_t>(steps) * bands_);
    for (auto& bucket : buckets_) bucket.clear();
  }

  /// Step 1 ... steps, band 0 ... bands - 1.
  std::vector<Event>& bucket(int step, int band) {
    return buckets_[static_cast<std::size_t>(step - 1) * bands_ + static_cast<std::size_t>(band)];
  }

  std::span<const Bucket> buckets() const { return buckets_; }
  int bands() const { return static_cast<int>(bands_); }

  /// Number of events in all buckets.
  std::size_t size() const;

  /// Writes size() events, sorted by time and within a time in raster order.
  void copy_to(Event* out) const;
  void copy_to(Event* out, ThreadPool& threads) const;

 private:
  /// Copies the sorted events [first, last).
  void copy_part(std::size_t first, std::size_t last, Event* out) const;

  std::vector<Bucket> buckets_;
  std::size_t bands_ = 1;
};

}  // namespace eventcamera
