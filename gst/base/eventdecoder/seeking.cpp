// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventdecoder/seeking.hpp"

#include <mutex>

#include "gst/base/eventdecoder/pulled.hpp"
#include "gst/base/eventdecoder/state.hpp"
#include "gst/base/seek_request.hpp"

namespace eventdecoder {

bool can_seek(GstEventDecoder* self) {
  {
    const std::lock_guard lock(self->priv->mutex);
    if (self->priv->pulls) return true;
  }
  if (reads_files(self)) return false;
  GstQuery* query = gst_query_new_seeking(GST_FORMAT_BYTES);
  gboolean seekable = FALSE;
  if (gst_pad_peer_query(self->priv->sink, query))
    gst_query_parse_seeking(query, nullptr, &seekable, nullptr, nullptr);
  gst_query_unref(query);
  return seekable;
}

static gboolean seek_pulling(GstEventDecoder* self, const Restart& restart, bool flush) {
  auto* priv = self->priv;
  const auto send_both = [&](GstEvent* event) {
    gst_event_set_seqnum(event, restart.seqnum);
    gst_pad_push_event(priv->sink, gst_event_ref(event));
    gst_pad_push_event(priv->src, event);
  };
  if (flush)
    send_both(gst_event_new_flush_start());
  else
    gst_pad_pause_task(priv->sink);
  GST_PAD_STREAM_LOCK(priv->sink);
  if (flush) send_both(gst_event_new_flush_stop(TRUE));
  bool ok = true;
  if (priv->state && priv->state->scanned) {
    Restart found = restart;
    found.seek_point = seek_point_before(self, restart.segment.position);
    ok = priv->faults.guard([&] {
      restart_at(self, found);
      return GST_FLOW_OK;
    }) == GST_FLOW_OK;
  } else {
    const std::lock_guard lock(priv->mutex);
    priv->segment = restart.segment;
    priv->seqnum = restart.seqnum;
  }
  gst_pad_start_task(priv->sink, loop, self, nullptr);
  GST_PAD_STREAM_UNLOCK(priv->sink);
  return ok;
}

/// Upstream flushes and then sends a segment of bytes; there the seek is done.
static gboolean seek_pushed(GstEventDecoder* self, const Restart& restart, gdouble rate) {
  auto* priv = self->priv;
  Restart found = restart;
  found.seek_point = seek_point_before(self, restart.segment.position);
  {
    const std::lock_guard lock(priv->mutex);
    priv->restart = found;
  }
  GstEvent* event = gst_event_new_seek(
      rate, GST_FORMAT_BYTES, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET,
      static_cast<gint64>(found.seek_point.value_or(SeekPoint{}).position), GST_SEEK_TYPE_NONE, -1);
  gst_event_set_seqnum(event, restart.seqnum);
  if (gst_pad_push_event(priv->sink, event)) return TRUE;
  const std::lock_guard lock(priv->mutex);
  priv->restart.reset();
  return FALSE;
}

static gboolean seek(GstEventDecoder* self, GstEvent* event) {
  auto* priv = self->priv;
  const SeekRequest request(event);
  if (!request.plays_on_from_time() || !can_seek(self)) {
    GST_INFO_OBJECT(self, "refused to seek at rate %g in %s", request.rate(),
                    gst_format_get_name(request.format()));
    return FALSE;
  }
  Restart restart;
  bool pulls = false;
  {
    const std::lock_guard lock(priv->mutex);
    pulls = priv->pulls;
    restart.segment = priv->segment;
    restart.segment.duration = priv->duration;
    restart.seqnum = request.seqnum();
    if (!request.apply(restart.segment)) return FALSE;
  }
  if (pulls) return seek_pulling(self, restart, request.flushes());
  return request.flushes() && seek_pushed(self, restart, request.rate());
}

gboolean src_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  auto* self = GST_EVENT_DECODER(parent);
  if (GST_EVENT_TYPE(event) != GST_EVENT_SEEK || is_timed(self))
    return gst_pad_event_default(pad, parent, event);
  const gboolean done = seek(self, event);
  gst_event_unref(event);
  return done;
}

}  // namespace eventdecoder
