// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>
#include <tuple>

#include "gst/base/errors.hpp"
#include "gst/base/event_caps.hpp"

/// Segment of a SEGMENT event, which owns it.
inline const GstSegment& segment_of(GstEvent* event) {
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  return *segment;
}

/// True if both segments give a timestamp the same running time and the same stream time.
inline bool continues(const GstSegment& current, const GstSegment& next) {
  const guint64 position = current.start > next.start ? current.start : next.start;
  const auto times = [&](const GstSegment& segment) {
    guint64 running = 0;
    guint64 stream = 0;
    const gint running_sign =
        gst_segment_to_running_time_full(&segment, segment.format, position, &running);
    const gint stream_sign =
        gst_segment_to_stream_time_full(&segment, segment.format, position, &stream);
    return std::tuple(segment.format, segment.rate, running_sign, running, stream_sign, stream);
  };
  return times(current) == times(next);
}

/// Posts an error message about a SEGMENT event, which it unrefs. Returns false.
inline bool refuse_segment(gpointer element, GstEvent* event, const Report& report) {
  gchar* const cause = gst_info_strdup_printf("segment %" GST_SEGMENT_FORMAT, &segment_of(event));
  post_message(element, GST_MESSAGE_ERROR, report, cause);
  g_free(cause);
  gst_event_unref(event);
  return false;
}

/// True if a SEGMENT event has a positive rate. Otherwise posts an error message of `element` and
/// unrefs the event. `verb` is what the element does with events, such as "merge".
inline bool plays_forwards(gpointer element, GstEvent* event, const char* verb) {
  return segment_of(event).rate > 0 ||
         refuse_segment(
             element, event,
             {GST_STREAM_ERROR_FAILED,
              std::string("Cannot ") + verb + " events backwards; play at a positive rate."});
}

/// Like plays_forwards(), and also requires a segment in time format.
inline bool plays_events(gpointer element, GstEvent* event, const char* verb) {
  const GstFormat format = segment_of(event).format;
  if (format == GST_FORMAT_TIME) return plays_forwards(element, event, verb);
  return refuse_segment(
      element, event,
      {GST_STREAM_ERROR_FORMAT, std::string("Cannot ") + verb + " " + gst_format_get_name(format) +
                                    ": this stream has no timestamps. Insert a reader of event "
                                    "files upstream, such as decodebin " ASK_FOR_EVENTS "."});
}
