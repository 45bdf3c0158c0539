// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/pulling.hpp"

gboolean activate_pulling(GstPad* sink, GstObject* /*parent*/) {
  GstQuery* const query = gst_query_new_scheduling();
  const bool pulls = gst_pad_peer_query(sink, query) != FALSE &&
                     gst_query_has_scheduling_mode_with_flags(
                         query, GST_PAD_MODE_PULL, GST_SCHEDULING_FLAG_SEEKABLE) != FALSE;
  gst_query_unref(query);
  return gst_pad_activate_mode(sink, pulls ? GST_PAD_MODE_PULL : GST_PAD_MODE_PUSH, TRUE);
}

guint64 upstream_bytes(GstPad* sink) {
  gint64 size = 0;
  const bool known = gst_pad_peer_query_duration(sink, GST_FORMAT_BYTES, &size) != FALSE;
  return known && size > 0 ? static_cast<guint64>(size) : 0;
}
