// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/eventrender/state.hpp"

void GstEventRenderPrivate::begin_anew() {
  if (state) state->renderer.reset();
  discontinuous = times.has_value();
  times.reset();
  taken.reset();
  known = 0;
  waiting_since.reset();
}

namespace eventrender {

Settings settings_of(GstEventRender* self) {
  const std::lock_guard lock(self->priv->mutex);
  return self->priv->settings;
}

GstAggregatorPad* sink_pad(GstEventRender* self) {
  return GST_AGGREGATOR_PAD(GST_ELEMENT(self)->sinkpads->data);
}

GstSegment segment_of(GstEventRender* self) {
  GstAggregatorPad* pad = sink_pad(self);
  GST_OBJECT_LOCK(pad);
  GstSegment segment = pad->segment;
  GST_OBJECT_UNLOCK(pad);
  // Live sources send theirs with their first buffer.
  if (segment.format != GST_FORMAT_TIME) gst_segment_init(&segment, GST_FORMAT_TIME);
  return segment;
}

void report_no_memory(GstEventRender* self) {
  self->priv->state.reset();
  GST_ELEMENT_ERROR(self, RESOURCE, NO_SPACE_LEFT,
                    ("There is not enough memory to draw these events."), (nullptr));
}

}  // namespace eventrender
