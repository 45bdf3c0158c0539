// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/fired_pixels.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Events of one interval, grouped by band of rows and by step (StepBuckets) or time (TimeSlices):
/// threads fill and draw bands concurrently. write_to() sorts them.
class EventBuckets {
 public:
  virtual ~EventBuckets() = default;

  int bands() const { return static_cast<int>(bands_); }

  virtual std::size_t size() const = 0;

  /// Writes size() events, sorted by time, then in raster order.
  void write_to(Event* out, ThreadPool& threads) const;

  /// Passes all events of a band to `visit`, in several calls.
  using Visit = std::function<void(std::span<const Event>)>;
  virtual void visit_band(int band, const Visit& visit) const = 0;

 protected:
  EventBuckets() = default;
  EventBuckets(const EventBuckets&) = default;
  EventBuckets& operator=(const EventBuckets&) = default;

  /// Writes the sorted events [first, last) to out + first. A FiredPixels or a time slice is
  /// written whole, by the call whose range contains its first event.
  virtual void write_part(std::size_t first, std::size_t last, Event* out) const = 0;

  std::size_t bands_ = 1;
};

/// A bucket per step and band: a list of events, or a bit per fired pixel, expanded to an event
/// when written. Each thread fills its own buckets.
class StepBuckets final : public EventBuckets {
 public:
  /// Empties the buckets but keeps their memory.
  void reset(int steps, int bands) {
    bands_ = static_cast<std::size_t>(bands);
    buckets_.resize(static_cast<std::size_t>(steps) * bands_);
    for (auto& bucket : buckets_) {
      bucket.events.clear();
      bucket.pixels.begin(0);
    }
  }

  /// Step 1 ... steps, band 0 ... bands - 1.
  std::vector<Event>& bucket(int step, int band) { return at(step, band).events; }
  FiredPixels& pixels(int step, int band) { return at(step, band).pixels; }

  /// Passes the list and the pixels of each bucket to visit(std::span<const Event>, const
  /// FiredPixels&), in the order of time; at most one of them is not empty.
  template <class VisitBucket>
  void visit_buckets(const VisitBucket& visit) const {
    for (const auto& [events, pixels] : buckets_) visit(std::span<const Event>(events), pixels);
  }

  std::size_t size() const override;
  void visit_band(int band, const Visit& visit) const override;

 private:
  /// On its own cache line, because threads fill neighbouring buckets concurrently.
  struct alignas(64) Bucket {
    std::vector<Event> events;
    FiredPixels pixels;
  };

  Bucket& at(int step, int band) {
    return buckets_[static_cast<std::size_t>(step - 1) * bands_ + static_cast<std::size_t>(band)];
  }
  void write_part(std::size_t first, std::size_t last, Event* out) const override;

  std::vector<Bucket> buckets_;
};

}  // namespace eventcamera
