// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/seek_request.hpp"

#include <algorithm>

SeekRequest::SeekRequest(GstEvent* event) : seqnum_(gst_event_get_seqnum(event)) {
  gst_event_parse_seek(event, &rate_, &format_, &flags_, &start_type_, &start_, &stop_type_,
                       &stop_);
}

/// Start or stop of the segment after the seek, computed as in gst_segment_do_seek().
static guint64 place(GstSeekType type, gint64 asked, guint64 kept, guint64 duration) {
  const bool is_known = GST_CLOCK_TIME_IS_VALID(duration);
  if (type == GST_SEEK_TYPE_SET && asked < 0) return GST_CLOCK_TIME_NONE;
  if (type == GST_SEEK_TYPE_SET) kept = static_cast<guint64>(asked);
  if (type == GST_SEEK_TYPE_END && is_known)
    kept = static_cast<guint64>(std::max<gint64>(static_cast<gint64>(duration) + asked, 0));
  return is_known && GST_CLOCK_TIME_IS_VALID(kept) ? std::min(kept, duration) : kept;
}

bool SeekRequest::apply(GstSegment& segment) const {
  // gst_segment_do_seek() asserts start <= stop.
  const auto start = place(start_type_, start_, segment.start, segment.duration);
  const auto stop = place(stop_type_, stop_, segment.stop, segment.duration);
  if (start > stop) return false;  // GST_CLOCK_TIME_NONE (no stop) is the largest value
  return gst_segment_do_seek(&segment, rate_, format_, flags_, start_type_,
                             static_cast<guint64>(start_), stop_type_, static_cast<guint64>(stop_),
                             nullptr) != FALSE;
}
