// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/filters/eventmerge_pad.hpp"

#include <algorithm>

#include "gst/aggregator/sink_pads.hpp"
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
  properties.add(&SensorPosition::x,
                 g_param_spec_uint("xpos", "X position",
                                   "Column of the output where this sensor starts (pixels)", 0,
                                   eventcamera::max_side - 1, 0, mutable_playing_flags));
  properties.add(
      &SensorPosition::y,
      g_param_spec_uint("ypos", "Y position", "Row of the output where this sensor starts (pixels)",
                        0, eventcamera::max_side - 1, 0, mutable_playing_flags));
}

/// Timestamp of an input at a stream time; negative before timestamp 0.
static GstClockTimeDiff timestamp_in(GstAggregatorPad* pad, gint64 stream_time) {
  const GstSegment segment = GST_EVENT_MERGE_PAD(pad)->priv->segment.copy();
  guint64 distance = 0;
  const gint sign = gst_segment_position_from_stream_time_full(
      &segment, GST_FORMAT_TIME, static_cast<guint64>(stream_time), &distance);
  return sign * static_cast<GstClockTimeDiff>(distance);
}

MergedTimeline::MergedTimeline(GstElement* element) : element_(element) {
  for_each_sink_pad(
      element, [&](GstAggregatorPad* pad) { start_ = std::min(start_, timestamp_in(pad, 0)); });
}

std::optional<gint64> MergedTimeline::duration() const {
  std::optional<gint64> longest;
  for_each_sink_pad(element_, [&](GstAggregatorPad* pad) {
    gint64 duration = -1;
    if (gst_pad_peer_query_duration(GST_PAD(pad), GST_FORMAT_TIME, &duration) && duration >= 0)
      longest = std::max(longest.value_or(0), timestamp_in(pad, duration) - start_);
  });
  return longest;
}

GstClockTime MergedTimeline::timestamp_at(gint64 stream_time) const {
  if (start_ < 0 && stream_time < -start_) return 0;
  return static_cast<GstClockTime>(start_) + static_cast<GstClockTime>(stream_time);
}

/// Replaces the next seek with `seek` if they have the same sequence number.
static GstPadProbeReturn replace_seek(GstPad*, GstPadProbeInfo* info, gpointer seek) {
  GstEvent* const next = GST_PAD_PROBE_INFO_EVENT(info);
  if (GST_EVENT_TYPE(next) != GST_EVENT_SEEK) return GST_PAD_PROBE_OK;
  if (gst_event_get_seqnum(next) == gst_event_get_seqnum(GST_EVENT(seek)))
    gst_event_replace(reinterpret_cast<GstEvent**>(&info->data), GST_EVENT(seek));
  return GST_PAD_PROBE_REMOVE;
}

void MergedTimeline::translate(const SeekRequest& request) const {
  // gst_aggregator_event_forward_func() sends one event straight to the peer of each pad, past the
  // probes of the pad itself, and no virtual function of GstAggregator sees it there.
  for_each_sink_pad(element_, [&](GstAggregatorPad* pad) {
    const OwnedPad peer(gst_pad_get_peer(GST_PAD(pad)));
    if (!peer) return;
    OwnedEvent seek = request.in_later_stream(timestamp_in(pad, 0) - start_).event();
    gst_pad_add_probe(
        peer.get(), GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, replace_seek, seek.release(),
        +[](gpointer event) { gst_event_unref(GST_EVENT(event)); });
  });
}
