// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/frame_clock.hpp"

#include "gst/base/video_frame.hpp"

static bool has_live_source(GstBaseTransform* element) {
  GstQuery* query = gst_query_new_latency();
  gboolean live = FALSE;
  if (gst_pad_peer_query(GST_BASE_TRANSFORM_SINK_PAD(element), query))
    gst_query_parse_latency(query, &live, nullptr, nullptr);
  gst_query_unref(query);
  return live != FALSE;
}

std::optional<GstClockTime> FrameClock::time_of_arrival(GstBaseTransform* element) {
  if (!live_) live_ = has_live_source(element);
  if (!*live_) return std::nullopt;
  const GstClockTime now = gst_element_get_current_running_time(GST_ELEMENT(element));
  const guint64 position =
      gst_segment_position_from_running_time(&element->segment, GST_FORMAT_TIME, now);
  if (!GST_CLOCK_TIME_IS_VALID(now) || !GST_CLOCK_TIME_IS_VALID(position)) return std::nullopt;
  return position;
}

FrameClock::Source FrameClock::stamp(GstBaseTransform* element, const GstVideoInfo& video,
                                     OwnedBuffer& frame) {
  const GstClockTime duration = frame_duration(video);
  Source source = Source::upstream;
  GstClockTime time = GST_BUFFER_PTS(frame.get());
  if (!GST_CLOCK_TIME_IS_VALID(time)) {
    if (const auto arrival = time_of_arrival(element)) {
      source = Source::arrival;
      time = *arrival;
    } else if (duration > 0) {
      source = Source::framerate;
      time = next_.value_or(element->segment.start);
    } else {
      return Source::nowhere;
    }
    frame.reset(gst_buffer_make_writable(frame.release()));
    GST_BUFFER_PTS(frame.get()) = time;
  }
  next_ = time + duration;
  return source;
}
