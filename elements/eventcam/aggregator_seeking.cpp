// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aggregator_seeking.hpp"

#include "gst/base/seek_request.hpp"

gboolean answer_seeking(GstAggregatorPad* pad, GstQuery* query) {
  return gst_pad_peer_query(GST_PAD(pad), query);
}

bool would_seek(GstAggregatorPad* pad, GstEvent* seek) {
  const SeekRequest request(seek);
  if (!request.plays_on_from_time()) return false;
  GstQuery* query = gst_query_new_seeking(GST_FORMAT_TIME);
  gboolean seekable = FALSE;
  if (answer_seeking(pad, query))
    gst_query_parse_seeking(query, nullptr, &seekable, nullptr, nullptr);
  gst_query_unref(query);
  if (!seekable) return false;
  GST_OBJECT_LOCK(pad);
  GstSegment segment = pad->segment;
  GST_OBJECT_UNLOCK(pad);
  if (segment.format != GST_FORMAT_TIME) gst_segment_init(&segment, GST_FORMAT_TIME);
  return request.apply(segment);
}
