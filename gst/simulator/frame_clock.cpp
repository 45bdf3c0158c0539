// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/frame_clock.hpp"

#include <string>

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

bool FrameClock::stamp(GstBaseTransform* element, const GstVideoInfo& video, OwnedBuffer& frame) {
  const GstClockTime duration = frame_duration(video);
  GstClockTime time = GST_BUFFER_PTS(frame.get());
  if (!GST_CLOCK_TIME_IS_VALID(time)) {
    const char* text =
        "The video has neither timestamps nor a framerate, so there are no events. Set the PTS of "
        "its buffers, or a framerate in its caps.";
    if (const auto arrival = time_of_arrival(element)) {
      time = *arrival;
      text =
          "The video has no timestamps: using the arrival times of its frames. Set "
          "do-timestamp=true on the source, or the PTS of its buffers.";
    } else if (duration > 0) {
      time = next_.value_or(element->segment.start);
      text =
          "The video has no timestamps: using its framerate. Set the PTS of its buffers if frames "
          "are not evenly spaced.";
    }
    warn_of_no_pts_(element, {GST_STREAM_ERROR_FORMAT, text},
                    "a buffer has no PTS; the framerate in the caps is " +
                        std::to_string(GST_VIDEO_INFO_FPS_N(&video)) + "/" +
                        std::to_string(GST_VIDEO_INFO_FPS_D(&video)));
    if (!GST_CLOCK_TIME_IS_VALID(time)) return false;
    frame.reset(gst_buffer_make_writable(frame.release()));
    GST_BUFFER_PTS(frame.get()) = time;
  }
  next_ = time + duration;
  return true;
}
