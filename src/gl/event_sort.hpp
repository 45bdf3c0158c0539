// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/luma.hpp"
#include "src/gl/objects.hpp"

namespace eventcamera::gl {

/// Radix sort of lists of events, in the order of is_before(). A list is a buffer that begins with
/// the number of events and its capacity; events beyond the capacity are missing. Events past the
/// end of the interval, which differ from without_cause(), come last, in raster order.
class EventSort {
 public:
  EventSort(const Context& gl, const LumaFormat& format);

  /// Returns the list to write, as large as `sorted`.
  Buffer& unsorted(const Buffer& sorted);

  /// Queues the sorting of unsorted() into `sorted`. `duration` is the interval's, in microseconds.
  void run(const Buffer& sorted, std::uint32_t duration) const;

 private:
  int width_;
  int place_passes_;
  Kernel kernel_;
  Buffer counts_;
  Buffer lists_[2];  ///< passes alternate between these, until the last one
};

}  // namespace eventcamera::gl
