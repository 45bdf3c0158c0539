// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Events of one interval as kernels produce them: a bucket per step and band of rows. With more
/// than one band, a bucket holds the events of its rows only, so that threads can draw bands
/// concurrently. Each thread fills its own buckets; concatenated in order, they are the sorted
/// events of the interval.
class EventBuckets {
 public:
  /// On its own cache line, because threads fill neighbouring buckets concurrently.
  struct alignas(64) Bucket : std::vector<Event> {};

  /// Empties the buckets but keeps their memory.
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

  /// Writes size() events, sorted by time, then in raster order.
  void copy_to(Event* out) const;
  void copy_to(Event* out, ThreadPool& threads) const;

 private:
  /// Copies the sorted events [first, last).
  void copy_part(std::size_t first, std::size_t last, Event* out) const;

  std::vector<Bucket> buckets_;
  std::size_t bands_ = 1;
};

}  // namespace eventcamera
