// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include "gst/base/event_buffer.hpp"

/// True if events of a segment can be used: it has times, and a positive rate. Else posts an error
/// message of `element`, which says what it cannot do: `verb` events, such as "merge".
inline bool plays_events(gpointer element, const GstSegment& segment, const char* verb) {
  if (segment.format != GST_FORMAT_TIME) {
    GST_ELEMENT_ERROR(element, STREAM, FORMAT,
                      ("Cannot %s %s: this stream has no timestamps. Insert a reader of event "
                       "files upstream, such as decodebin " ASK_FOR_EVENTS ".",
                       verb, gst_format_get_name(segment.format)),
                      ("segment %" GST_SEGMENT_FORMAT, &segment));
    return false;
  }
  if (segment.rate < 0) {
    GST_ELEMENT_ERROR(element, STREAM, FAILED,
                      ("Cannot %s events backwards; play at a positive rate.", verb),
                      ("segment %" GST_SEGMENT_FORMAT, &segment));
    return false;
  }
  return true;
}

/// The same of a SEGMENT event.
inline bool plays_events(gpointer element, GstEvent* event, const char* verb) {
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  return plays_events(element, *segment, verb);
}
