// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventdecoder/queries.hpp"

#include <mutex>

#include "gst/base/eventdecoder/duration.hpp"
#include "gst/base/eventdecoder/seeking.hpp"
#include "gst/base/eventdecoder/state.hpp"
#include "gst/base/latency.hpp"

namespace eventdecoder {

gboolean src_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  auto* self = GST_EVENT_DECODER(parent);
  auto* priv = self->priv;
  GstFormat format = GST_FORMAT_UNDEFINED;
  if (is_timed(self)) {
    const auto own = static_cast<GstClockTime>(interval_length(self)) * GST_USECOND;
    return (GST_QUERY_TYPE(query) == GST_QUERY_LATENCY && answer_latency(priv->sink, query, own)) ||
           gst_pad_query_default(pad, parent, query);
  }
  switch (GST_QUERY_TYPE(query)) {
    case GST_QUERY_POSITION: {
      gst_query_parse_position(query, &format, nullptr);
      if (format != GST_FORMAT_TIME) break;
      const std::lock_guard lock(priv->mutex);
      gst_query_set_position(query, format, static_cast<gint64>(priv->segment.position));
      return TRUE;
    }
    case GST_QUERY_DURATION: {
      gst_query_parse_duration(query, &format, nullptr);
      if (format != GST_FORMAT_TIME) break;
      const GstClockTime duration = duration_of(self);
      if (!GST_CLOCK_TIME_IS_VALID(duration)) return FALSE;
      gst_query_set_duration(query, format, static_cast<gint64>(duration));
      return TRUE;
    }
    case GST_QUERY_SEEKING: {
      gst_query_parse_seeking(query, &format, nullptr, nullptr, nullptr);
      if (format != GST_FORMAT_TIME) break;
      const GstClockTime duration = duration_of(self);
      gst_query_set_seeking(query, format, can_seek(self), 0,
                            GST_CLOCK_TIME_IS_VALID(duration) ? static_cast<gint64>(duration) : -1);
      return TRUE;
    }
    default:
      break;
  }
  return gst_pad_query_default(pad, parent, query);
}

}  // namespace eventdecoder
