// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

/// Answers a latency query on a source pad: upstream's latency plus the element's own.
inline gboolean answer_latency(GstPad* sink, GstQuery* query, GstClockTime own) {
  if (!gst_pad_peer_query(sink, query)) return FALSE;
  gboolean live = FALSE;
  GstClockTime min = 0;
  GstClockTime max = 0;
  gst_query_parse_latency(query, &live, &min, &max);
  gst_query_set_latency(query, live, min + own,
                        GST_CLOCK_TIME_IS_VALID(max) ? max + own : GST_CLOCK_TIME_NONE);
  return TRUE;
}
