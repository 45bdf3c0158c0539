// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/fired_pixels.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Events of one interval as kernels produce them: a bucket per step and band of rows. With more
/// than one band, a bucket holds the events of its rows only, so that threads can draw bands
/// concurrently. Each thread fills its own buckets; written in order, they are the sorted events of
/// the interval. Instead of steps, a band may have time slices, whose events are sorted when they
/// are written.
class EventBuckets {
 public:
  /// Either a list of events, or the pixels that fire in a step, which become events when they are
  /// written. On its own cache line, because threads fill neighbouring buckets concurrently.
  struct alignas(64) Bucket {
    std::vector<Event> events;
    FiredPixels pixels;

    std::size_t size() const { return events.size() + pixels.size(); }
  };

  /// Empties the buckets but keeps their memory.
  void reset(int steps, int bands) {
    slice_bits_.reset();
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

  /// Like reset(), for an interval of `duration` microseconds whose events are added in any order.
  void reset_slices(std::uint32_t duration, int bands);

  /// Adds all events of a band to its time slices. Different bands may be added from different
  /// threads.
  void add_slices(int band, std::span<const Event> events);

  int bands() const { return static_cast<int>(bands_); }

  /// Number of events in all buckets.
  std::size_t size() const;

  /// Writes size() events, sorted by time, then in raster order.
  void write_to(Event* out, ThreadPool& threads) const;

  /// Passes all events of a band to visit(std::span<const Event>), step by step, in several calls.
  template <class Visit>
  void visit_band(int band, const Visit& visit) const {
    for (auto i = static_cast<std::size_t>(band); i < buckets_.size(); i += bands_) {
      visit(std::span<const Event>(buckets_[i].events));
      buckets_[i].pixels.visit(visit);
    }
  }

 private:
  Bucket& at(int step, int band) {
    return buckets_[static_cast<std::size_t>(step - 1) * bands_ + static_cast<std::size_t>(band)];
  }
  /// Writes the sorted events [first, last) of lists. Events of a FiredPixels or of a time slice
  /// are written if the first of them is in that range.
  void write_part(std::size_t first, std::size_t last, Event* out) const;
  void write_slices(std::size_t first, std::size_t last, Event* out) const;

  static constexpr int max_slices_bits = 8;  ///< so many that a slice fits into a cache

  /// Indices in the only bucket of a band at which its time slices begin, and the end of the last.
  struct alignas(64) SliceStarts : std::array<std::size_t, (1 << max_slices_bits) + 1> {};

  std::vector<Bucket> buckets_;
  std::size_t bands_ = 1;
  std::optional<int> slice_bits_;    ///< bands have time slices of 2^slice_bits_ microseconds
  std::vector<SliceStarts> slices_;  ///< by band
};

}  // namespace eventcamera
