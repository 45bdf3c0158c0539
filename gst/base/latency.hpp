// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

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

/// For init: posts a latency message whenever this property, part of the latency, is set.
inline void announce_latency(gpointer element, const char* property) {
  const auto post = +[](GstElement* changed) {
    gst_element_post_message(changed, gst_message_new_latency(GST_OBJECT(changed)));
  };
  g_signal_connect(element, (std::string("notify::") + property).c_str(), G_CALLBACK(post),
                   nullptr);
}
