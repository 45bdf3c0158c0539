// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <cstdlib>
#include <optional>

/// Segment that maps timestamps of a sender or camera to the running times of their arrival.
class ArrivalSegment {
 public:
  /// The mapping follows drifts of more than `max_drift`.
  explicit ArrivalSegment(GstClockTimeDiff max_drift) : max_drift_(max_drift) {}

  /// True if the segment maps `start` to its arrival, a running time, within max_drift. If the
  /// arrival is unknown, `start` must not precede the previous data.
  bool continues(GstClockTime start, GstClockTime arrival) const {
    if (!segment_ || start < segment_->start) return false;
    if (!GST_CLOCK_TIME_IS_VALID(arrival))
      return GST_CLOCK_DIFF(start, segment_->position) <= max_drift_;
    const auto mapped = gst_segment_to_running_time(&*segment_, GST_FORMAT_TIME, start);
    return std::abs(GST_CLOCK_DIFF(mapped, arrival)) <= max_drift_;
  }

  /// Pushes a segment that maps `start` to its arrival, a running time, or to the end of the
  /// previous segment if that is unknown. The stream time defaults to the running time. Returns the
  /// running time of `start`.
  GstClockTime begin(GstPad* src, guint32 seqnum, GstClockTime start, GstClockTime arrival,
                     GstClockTime stream_time) {
    GstSegment next;
    gst_segment_init(&next, GST_FORMAT_TIME);
    next.start = next.position = start;
    if (GST_CLOCK_TIME_IS_VALID(arrival))
      next.base = arrival;
    else if (segment_)
      next.base = gst_segment_to_running_time(&*segment_, GST_FORMAT_TIME, segment_->position);
    next.time = GST_CLOCK_TIME_IS_VALID(stream_time) ? stream_time : next.base;
    segment_ = next;
    GstEvent* const event = gst_event_new_segment(&next);
    gst_event_set_seqnum(event, seqnum);
    gst_pad_push_event(src, event);
    return next.base;
  }

  bool has_begun() const { return segment_.has_value(); }

  /// Extends the end of the received data to `end`.
  void extend_to(GstClockTime end) { segment_->position = std::max(segment_->position, end); }

  /// Ends the segment; the next data start a new one.
  void reset() { segment_.reset(); }

 private:
  GstClockTimeDiff max_drift_;
  std::optional<GstSegment> segment_;
};
