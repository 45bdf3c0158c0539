// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "src/core/event_buckets.hpp"

namespace eventcamera {

/// Events of an interval, which each band adds in any order. They are sorted slice by slice when
/// written.
class TimeSlices final : public EventBuckets {
 public:
  /// Empties the slices but keeps their memory. The interval lasts `duration` microseconds.
  void reset(std::uint32_t duration, int bands);

  /// Adds all events of a band. Different bands may be added from different threads.
  void add(int band, std::span<const Event> events);

  std::size_t size() const override;
  void visit_band(int band, const Visit& visit) const override;

 private:
  void write_part(std::size_t first, std::size_t last, Event* out) const override;

  static constexpr int max_slices_bits = 8;  ///< a slice fits into a cache

  /// On its own cache line, because threads fill neighbouring bands concurrently.
  struct alignas(64) Band {
    std::vector<Event> events;  ///< slice by slice
    /// Indices in `events` at which slices begin, and the end of the last.
    std::array<std::size_t, (1 << max_slices_bits) + 1> starts;
  };

  int slice_bits_ = 0;  ///< a slice lasts 2^slice_bits_ microseconds
  std::vector<Band> slices_;
};

}  // namespace eventcamera
