// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventdecoder/pulled.hpp"

#include <mutex>

#include "gst/base/eventdecoder/decoding.hpp"
#include "gst/base/eventdecoder/duration.hpp"
#include "gst/base/eventdecoder/ending.hpp"
#include "gst/base/eventdecoder/event_file.hpp"
#include "gst/base/eventdecoder/state.hpp"
#include "gst/base/file_streams.hpp"
#include "gst/base/owned.hpp"

namespace eventdecoder {

/// The end of the file, or of the segment.
static void end_stream(GstEventDecoder* self) {
  auto* priv = self->priv;
  GstSegment segment;
  {
    const std::lock_guard lock(priv->mutex);
    segment = priv->segment;
  }
  gst_pad_push_event(priv->src, end_of_streams(GST_ELEMENT(self), segment, priv->seqnum));
}

static GstFlowReturn read_on(GstEventDecoder* self) {
  auto* priv = self->priv;
  if (!priv->state) {
    const OwnedCaps caps(gst_pad_peer_query_caps(priv->sink, nullptr));
    if (gst_caps_is_fixed(caps.get())) priv->caps.reset(gst_caps_copy(caps.get()));
    const GstFlowReturn result = priv->faults.guard([&] {
      begin(self);
      return GST_FLOW_OK;
    });
    if (result != GST_FLOW_OK) return result;
  }
  if (!priv->state->scanned) {
    if (reads_files(self)) return priv->faults.guard([&] { return scan_file(self); });
    return scan(self);
  }
  const GstFlowReturn result = reads_files(self) ? pull_events(self) : pull_bytes(self);
  if (result != GST_FLOW_EOS) return result;
  return priv->faults.guard([&] {
    if (!priv->state->at_end) return GST_FLOW_EOS;  // a segment may end before the file does
    const GstFlowReturn ended = take_end(self);
    set_duration(self, duration_so_far(self));
    return ended == GST_FLOW_OK ? GST_FLOW_EOS : ended;
  });
}

void loop(gpointer element) {
  auto* self = GST_EVENT_DECODER(element);
  const GstFlowReturn result = read_on(self);
  if (result == GST_FLOW_OK) return;
  GST_DEBUG_OBJECT(self, "pausing: %s", gst_flow_get_name(result));
  gst_pad_pause_task(self->priv->sink);
  if (result == GST_FLOW_EOS) {
    end_stream(self);
  } else if (result == GST_FLOW_ERROR || result == GST_FLOW_NOT_LINKED || result < GST_FLOW_EOS) {
    if (result != GST_FLOW_ERROR) GST_ELEMENT_FLOW_ERROR(self, result);
    gst_pad_push_event(self->priv->src, gst_event_new_eos());
  }
}

gboolean activate_mode(GstPad* pad, GstObject* parent, GstPadMode mode, gboolean active) {
  auto* self = GST_EVENT_DECODER(parent);
  {
    const std::lock_guard lock(self->priv->mutex);
    self->priv->pulls = mode == GST_PAD_MODE_PULL && active;
  }
  if (mode != GST_PAD_MODE_PULL) return TRUE;
  return active ? gst_pad_start_task(pad, loop, self, nullptr) : gst_pad_stop_task(pad);
}

}  // namespace eventdecoder
