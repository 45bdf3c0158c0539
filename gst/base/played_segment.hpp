// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

#include "gst/base/errors.hpp"
#include "gst/base/event_buffer.hpp"

/// True if events of a segment can be used: it has times, and a positive rate. Else posts an error
/// message of `element`, which says what it cannot do: `verb` events, such as "merge".
inline bool plays_events(gpointer element, const GstSegment& segment, const char* verb) {
  const auto refuse = [&](const Report& report) {
    gchar* const cause = gst_info_strdup_printf("segment %" GST_SEGMENT_FORMAT, &segment);
    post_message(element, GST_MESSAGE_ERROR, report, cause);
    g_free(cause);
    return false;
  };
  if (segment.format != GST_FORMAT_TIME)
    return refuse({GST_STREAM_ERROR_FORMAT,
                   std::string("Cannot ") + verb + " " + gst_format_get_name(segment.format) +
                       ": this stream has no timestamps. Insert a reader of event files upstream, "
                       "such as decodebin " ASK_FOR_EVENTS "."});
  if (segment.rate < 0)
    return refuse({GST_STREAM_ERROR_FAILED,
                   std::string("Cannot ") + verb + " events backwards; play at a positive rate."});
  return true;
}

/// The same of a SEGMENT event.
inline bool plays_events(gpointer element, GstEvent* event, const char* verb) {
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  return plays_events(element, *segment, verb);
}
