// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aedatdemux/seeking.hpp"

#include <mutex>

#include "elements/eventcam/aedatdemux/pulled.hpp"
#include "elements/eventcam/aedatdemux/state.hpp"
#include "gst/base/file_streams.hpp"
#include "gst/base/seek_request.hpp"
#include "src/formats/aedat/aedat4_table.hpp"

namespace aedatdemux {

static gboolean push_to_pad(GstElement*, GstPad* pad, gpointer event) {
  gst_pad_push_event(pad, gst_event_ref(static_cast<GstEvent*>(event)));
  return TRUE;
}

/// Sends an event on to all that comes after, and takes it.
static void push_to_all(GstAedatDemux* self, GstEvent* event) {
  gst_element_foreach_src_pad(GST_ELEMENT(self), push_to_pad, event);
  gst_event_unref(event);
}

/// Goes to where everything from the segment's start on is read.
static void restart_reader(GstAedatDemux* self) {
  State& state = self->priv->state;
  const auto* const aedat4 = state.reader.aedat4();
  if (aedat4 == nullptr) {
    state.reader.restart();
    state.pulled = 0;
    return;
  }
  state.pulled = aedat4->packets_at();
  if (!state.table.empty())
    state.pulled = eventcamera::aedat4_position_of(state.table, output_start(self))
                       .value_or(aedat4->table_at().value_or(state.pulled));
  state.reader.resume(state.pulled);
}

static bool seek(GstAedatDemux* self, GstEvent* event) {
  auto* priv = self->priv;
  const SeekRequest request(event);
  GstSegment segment;
  {
    const std::lock_guard lock(priv->mutex);
    if (!priv->pulls || !priv->shown || !request.plays_on_from_time()) return false;
    segment = priv->segment;
  }
  if (!request.apply(segment)) return false;
  if (request.flushes()) {
    GstEvent* const begin = with_seqnum(gst_event_new_flush_start(), request.seqnum());
    gst_pad_push_event(priv->sink, gst_event_ref(begin));
    push_to_all(self, begin);
  } else {
    gst_pad_pause_task(priv->sink);
  }

  GST_PAD_STREAM_LOCK(priv->sink);
  if (request.flushes()) {
    GstEvent* const end = with_seqnum(gst_event_new_flush_stop(TRUE), request.seqnum());
    gst_pad_push_event(priv->sink, gst_event_ref(end));
    push_to_all(self, end);
  }
  {
    const std::lock_guard lock(priv->mutex);
    priv->segment = segment;
  }
  priv->seqnum = request.seqnum();
  restart_reader(self);
  begin_anew(self);
  gst_pad_start_task(priv->sink, loop, self, nullptr);
  GST_PAD_STREAM_UNLOCK(priv->sink);
  return true;
}

gboolean src_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_SEEK) return gst_pad_event_default(pad, parent, event);
  const bool sought = seek(demux_of(parent), event);
  gst_event_unref(event);
  return sought;
}

}  // namespace aedatdemux
