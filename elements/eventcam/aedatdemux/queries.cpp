// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aedatdemux/queries.hpp"

#include <mutex>

#include "gst/base/latency.hpp"

namespace aedatdemux {

gboolean src_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  auto* priv = demux_of(parent)->priv;
  GstSegment segment;
  GstClockTime buffer_time = 0;
  bool pulls = false;
  {
    const std::lock_guard lock(priv->mutex);
    segment = priv->segment;
    buffer_time = priv->buffer_time;
    pulls = priv->pulls;
  }
  GstFormat format = GST_FORMAT_TIME;
  switch (GST_QUERY_TYPE(query)) {
    case GST_QUERY_POSITION:
      gst_query_parse_position(query, &format, nullptr);
      if (format != GST_FORMAT_TIME) return FALSE;
      gst_query_set_position(query, format, static_cast<gint64>(segment.position));
      return TRUE;
    case GST_QUERY_DURATION:
      gst_query_parse_duration(query, &format, nullptr);
      if (format != GST_FORMAT_TIME || !GST_CLOCK_TIME_IS_VALID(segment.duration)) return FALSE;
      gst_query_set_duration(query, format, static_cast<gint64>(segment.duration));
      return TRUE;
    case GST_QUERY_SEEKING:
      gst_query_parse_seeking(query, &format, nullptr, nullptr, nullptr);
      gst_query_set_seeking(query, format, pulls && format == GST_FORMAT_TIME, 0,
                            static_cast<gint64>(segment.duration));
      return TRUE;
    case GST_QUERY_SEGMENT: {
      const auto stop = GST_CLOCK_TIME_IS_VALID(segment.stop) ? segment.stop : segment.duration;
      gst_query_set_segment(query, segment.rate, GST_FORMAT_TIME,
                            static_cast<gint64>(segment.start), static_cast<gint64>(stop));
      return TRUE;
    }
    case GST_QUERY_LATENCY:
      return answer_latency(priv->sink, query, buffer_time);
    default:
      return gst_pad_query_default(pad, parent, query);
  }
}

}  // namespace aedatdemux
