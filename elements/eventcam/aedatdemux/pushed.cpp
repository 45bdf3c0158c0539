// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aedatdemux/pushed.hpp"

#include <utility>

#include "elements/eventcam/aedatdemux/input.hpp"
#include "elements/eventcam/aedatdemux/output.hpp"
#include "elements/eventcam/aedatdemux/state.hpp"
#include "src/formats/aedat/aedat_reader.hpp"

namespace aedatdemux {

GstFlowReturn chain(GstPad*, GstObject* parent, GstBuffer* buffer) {
  auto* self = demux_of(parent);
  auto& flow = self->priv->flow;
  if (flow == GST_FLOW_OK) flow = take_bytes(self, buffer);
  gst_buffer_unref(buffer);
  return flow;
}

/// After a flush, bytes begin at the file's start, or where a byte segment says.
static void take_segment(GstAedatDemux* self, const GstSegment& segment) {
  auto* priv = self->priv;
  if (!std::exchange(priv->flushed, false)) return;
  AedatReader& reader = priv->state.reader;
  if (segment.format == GST_FORMAT_BYTES && segment.start > 0 && reader.aedat4() != nullptr &&
      reader.aedat4()->header_read())
    reader.resume(segment.start);
  else
    reader.restart();
}

gboolean sink_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  auto* self = demux_of(parent);
  auto* priv = self->priv;
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_STREAM_START:
    case GST_EVENT_CAPS:
      gst_event_unref(event);
      return TRUE;
    case GST_EVENT_SEGMENT: {
      GstSegment segment;
      gst_event_copy_segment(event, &segment);
      take_segment(self, segment);
      gst_event_unref(event);
      return TRUE;
    }
    case GST_EVENT_EOS: {
      priv->seqnum = gst_event_get_seqnum(event);
      gst_event_unref(event);
      if (priv->flow == GST_FLOW_OK)
        priv->flow = priv->faults.guard([&] { return take_end(self); });
      end_streams(self);
      return priv->flow == GST_FLOW_OK;
    }
    case GST_EVENT_FLUSH_STOP:
      priv->flushed = true;
      if (priv->state.holding)
        priv->state = State();
      else
        priv->state.reader.restart();
      begin_anew(self);
      return gst_pad_event_default(pad, parent, event);
    default:
      return gst_pad_event_default(pad, parent, event);
  }
}

}  // namespace aedatdemux
