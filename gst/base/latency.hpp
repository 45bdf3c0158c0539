// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <string>

/// Answers a latency query on a source pad: upstream's latency plus the element's own.
inline gboolean answer_latency(GstDebugCategory* category, GstPad* sink, GstQuery* query,
                               GstClockTime own) {
  if (!gst_pad_peer_query(sink, query)) return FALSE;
  gboolean live = FALSE;
  GstClockTime min = 0;
  GstClockTime max = 0;
  gst_query_parse_latency(query, &live, &min, &max);
  GST_CAT_DEBUG_OBJECT(category, sink,
                       "latency of upstream, %s: %" GST_TIME_FORMAT " to %" GST_TIME_FORMAT
                       "; own: %" GST_TIME_FORMAT,
                       live ? "live" : "not live", GST_TIME_ARGS(min), GST_TIME_ARGS(max),
                       GST_TIME_ARGS(own));
  gst_query_set_latency(query, live, min + own,
                        GST_CLOCK_TIME_IS_VALID(max) ? max + own : GST_CLOCK_TIME_NONE);
  return TRUE;
}

/// For init: posts a latency message whenever this property, part of the latency, is set.
inline void announce_latency(GstDebugCategory* category, gpointer element, const char* property) {
  const auto post = +[](GstElement* changed, GParamSpec* latency, gpointer log) {
    GST_CAT_DEBUG_OBJECT(static_cast<GstDebugCategory*>(log), changed,
                         "%s was set: latency may have changed", latency->name);
    gst_element_post_message(changed, gst_message_new_latency(GST_OBJECT(changed)));
  };
  const std::string notify = std::string("notify::").append(property);
  g_signal_connect(element, notify.c_str(), G_CALLBACK(post), category);
}
