// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aedatdemux/state.hpp"

#include <mutex>

namespace aedatdemux {

Microseconds interval_length(GstAedatDemux* self) {
  const std::lock_guard lock(self->priv->mutex);
  return static_cast<Microseconds>(self->priv->buffer_time / GST_USECOND);
}

Microseconds output_start(GstAedatDemux* self) {
  const std::lock_guard lock(self->priv->mutex);
  return self->priv->state.zero +
         static_cast<Microseconds>(self->priv->segment.start / GST_USECOND);
}

void reset(GstAedatDemux* self) {
  auto* priv = self->priv;
  priv->state = State();
  priv->flow = GST_FLOW_OK;
  priv->group = GST_GROUP_ID_INVALID;
  priv->seqnum = GST_SEQNUM_INVALID;
  priv->faults.begin_anew();
  priv->flushed = false;
  gst_flow_combiner_reset(priv->combiner);
  const std::lock_guard lock(priv->mutex);
  gst_segment_init(&priv->segment, GST_FORMAT_TIME);
  priv->shown = false;
  priv->counts = {};
}

void begin_anew(GstAedatDemux* self) {
  State& state = self->priv->state;
  gst_flow_combiner_reset(self->priv->combiner);
  self->priv->flow = GST_FLOW_OK;
  for (auto& stream : state.streams) {
    if (stream.kind == Aedat4Kind::events)
      stream.chunker = state.holding ? Chunker(interval_length(self))
                                     : Chunker(interval_length(self), output_start(self));
    stream.segment_due = true;
    stream.discontinuous = true;
  }
  const std::lock_guard lock(self->priv->mutex);
  for (auto& stream : state.streams) stream.position = self->priv->segment.start;
  state.newest = self->priv->segment.start;
}

}  // namespace aedatdemux
