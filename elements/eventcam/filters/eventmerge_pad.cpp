// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/filters/eventmerge_pad.hpp"

#include <utility>

#include "gst/base/played_segment.hpp"
#include "gst/base/properties.hpp"
#include "src/core/max_side.hpp"

G_DEFINE_TYPE(GstEventMergePad, gst_event_merge_pad, GST_TYPE_AGGREGATOR_PAD)

static Guarded<SensorPosition>& position_of(GObject* object) {
  return GST_EVENT_MERGE_PAD(object)->priv->position;
}

static void finalize(GObject* object) {
  delete GST_EVENT_MERGE_PAD(object)->priv;
  G_OBJECT_CLASS(gst_event_merge_pad_parent_class)->finalize(object);
}

static void gst_event_merge_pad_init(GstEventMergePad* self) {
  self->priv = new GstEventMergePadPrivate;
  const auto linked =
      +[](GstEventMergePad* pad, GstPad*, gpointer) { pad->priv->was_linked = true; };
  g_signal_connect(self, "linked", G_CALLBACK(linked), nullptr);
}

static void gst_event_merge_pad_class_init(GstEventMergePadClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->finalize = finalize;
  Properties<position_of> properties(object_class);
  properties.add(&SensorPosition::x, "xpos",
                 "Column of the output where this sensor starts (pixels)", 0,
                 eventcamera::max_side - 1);
  properties.add(&SensorPosition::y, "ypos", "Row of the output where this sensor starts (pixels)",
                 0, eventcamera::max_side - 1);
}

void GstEventMergePadPrivate::unload() {
  input.unload();
  loaded.reset();
}

void GstEventMergePadPrivate::flush() {
  unload();
  discontinuous = segment_is_new = goes_back = false;
}

void GstEventMergePadPrivate::stop() {
  sensor = {};
  segment_seqnum = GST_SEQNUM_INVALID;
  gst_segment_init(&*segment.lock(), GST_FORMAT_TIME);
}

void GstEventMergePadPrivate::handle_segment(GstEvent* event) {
  const auto last = std::exchange(*segment.lock(), segment_of(event));
  if (segment_seqnum != GST_SEQNUM_INVALID) segment_is_new |= !continues(last, segment_of(event));
  segment_seqnum = gst_event_get_seqnum(event);
}
