// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <optional>

#include "gst/base/arrival_segment.hpp"
#include "src/wire/arrival_clock.hpp"

/// Segments of a camera's stream: they map the camera's clock to running time, as its transfers
/// arrive.
class CameraSegment {
 public:
  using Nanoseconds = eventcamera::Nanoseconds;

  /// Records the arrival of data up to the time `sent`. After a gap, the camera's clock may have
  /// been reset.
  void arrive(eventcamera::Microseconds sent, GstClockTime arrival, bool after_gap) {
    is_due_ |= clock_.arrive(sent, static_cast<Nanoseconds>(arrival), after_gap);
  }

  /// Pushes a segment from `start` before data of these times, unless the last segment still holds.
  /// Returns the running time of `start` if it did. Data before running time 0, as in a first
  /// transfer, is late: the next data corrects the mapping.
  std::optional<GstClockTime> begin(GstPad* src, guint32 seqnum, GstClockTime start,
                                    GstClockTime end) {
    std::optional<GstClockTime> mapped;
    if (is_due_ || !segment_.continues(start, GST_CLOCK_TIME_NONE)) {
      const auto running = running_time_of(start);
      is_due_ = running && *running < 0;
      mapped = segment_.begin(src, seqnum, start,
                              running ? static_cast<GstClockTime>(std::max(*running, Nanoseconds{}))
                                      : GST_CLOCK_TIME_NONE,
                              start);
    }
    segment_.reach(end);
    return mapped;
  }

  bool has_begun() const { return segment_.has_begun(); }
  /// Running time of a camera time; none before the first transfer.
  std::optional<Nanoseconds> running_time_of(GstClockTime time) const {
    const auto offset = clock_.offset();
    return offset ? std::optional(static_cast<Nanoseconds>(time) + *offset) : std::nullopt;
  }

  /// Parts per million by which the camera's clock is slow.
  double drift() const { return clock_.drift(); }

 private:
  eventcamera::ArrivalClock clock_;
  ArrivalSegment segment_{0};
  bool is_due_ = false;  ///< a segment that corrects the mapping
};
