// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/luma.hpp"
#include "src/gl/objects.hpp"

namespace eventcamera::gl {

/// Sorts lists of events with is_before(), by a radix sort. A list is a buffer that begins with the
/// number of events and its capacity; if they do not fit, those that do are sorted. Events past the
/// end of the interval, which differ from without_cause(), come last, in raster order.
class EventSort {
 public:
  EventSort(const Context& gl, const LumaFormat& format);

  /// The list to write, as large as `sorted`.
  Buffer& unsorted(const Buffer& sorted);

  /// Queues the sorting of unsorted() into `sorted`. Does not wait. `duration` of the interval,
  /// microseconds.
  void run(const Buffer& sorted, std::uint32_t duration) const;

 private:
  int width_;
  int place_passes_;
  Kernel kernel_;
  Buffer counts_;
  Buffer lists_[2];  ///< passes alternate between these, until the last one
};

}  // namespace eventcamera::gl
