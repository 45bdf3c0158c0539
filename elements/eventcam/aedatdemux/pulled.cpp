// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aedatdemux/pulled.hpp"

#include <mutex>

#include "elements/eventcam/aedatdemux/duration.hpp"
#include "elements/eventcam/aedatdemux/input.hpp"
#include "elements/eventcam/aedatdemux/output.hpp"
#include "gst/base/file_streams.hpp"
#include "gst/base/pulling.hpp"

namespace aedatdemux {

static GstFlowReturn read_on(GstAedatDemux* self) {
  State& state = self->priv->state;
  GstBuffer* piece = nullptr;
  GstFlowReturn result = gst_pad_pull_range(self->priv->sink, state.pulled, pulled_piece, &piece);
  if (result == GST_FLOW_EOS) {
    result = self->priv->faults.guard([&] { return take_end(self); });
    if (result != GST_FLOW_OK) return result;
    learn_duration(self);
    return GST_FLOW_EOS;
  }
  if (result != GST_FLOW_OK) return result;
  state.pulled += gst_buffer_get_size(piece);
  result = take_bytes(self, piece);
  gst_buffer_unref(piece);
  return result;
}

void loop(gpointer element) {
  auto* self = demux_of(element);
  const GstFlowReturn result = read_on(self);
  if (result == GST_FLOW_OK) return;
  GST_DEBUG_OBJECT(self, "pausing: %s", gst_flow_get_name(result));
  gst_pad_pause_task(self->priv->sink);
  if (result == GST_FLOW_EOS) {
    end_streams(self);
  } else if (result == GST_FLOW_NOT_LINKED || result < GST_FLOW_EOS) {
    if (result != GST_FLOW_ERROR) GST_ELEMENT_FLOW_ERROR(self, result);
    for (auto& stream : self->priv->state.streams)
      if (stream.pad != nullptr)
        gst_pad_push_event(stream.pad, with_seqnum(gst_event_new_eos(), self->priv->seqnum));
  }
}

gboolean activate_mode(GstPad* pad, GstObject* parent, GstPadMode mode, gboolean active) {
  auto* self = demux_of(parent);
  {
    const std::lock_guard lock(self->priv->mutex);
    self->priv->pulls = mode == GST_PAD_MODE_PULL && active != FALSE;
  }
  if (mode == GST_PAD_MODE_PUSH) return TRUE;
  return active ? gst_pad_start_task(pad, loop, self, nullptr) : gst_pad_stop_task(pad);
}

}  // namespace aedatdemux
