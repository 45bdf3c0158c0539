// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/filters/merged_timeline.hpp"

#include "gst/aggregator/eventaggregator.hpp"

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

/// Timestamp of an input at a stream time; negative before timestamp 0.
static GstClockTimeDiff timestamp_in(GstAggregatorPad* pad, gint64 stream_time) {
  const GstSegment segment = GST_EVENT_MERGE_PAD(pad)->priv->segment.copy();
  guint64 distance = 0;
  const gint sign = gst_segment_position_from_stream_time_full(
      &segment, GST_FORMAT_TIME, static_cast<guint64>(stream_time), &distance);
  return sign * static_cast<GstClockTimeDiff>(distance);
}

/// Timestamp at which the first input starts.
GstClockTimeDiff MergedTimeline::start() const {
  GstClockTimeDiff start = G_MAXINT64;
  for_each_sink_pad(element_,
                    [&](GstAggregatorPad* pad) { start = std::min(start, timestamp_in(pad, 0)); });
  return start;
}

GstClockTime MergedTimeline::timestamp_at(gint64 stream_time) const {
  const auto zero = start();
  if (zero < 0 && stream_time < -zero) return 0;
  return static_cast<GstClockTime>(zero) + static_cast<GstClockTime>(stream_time);
}

GstSegment MergedTimeline::longest_segment(const OwnedAggregatorPad& of,
                                           std::span<const OwnedAggregatorPad> pads) {
  GstSegment segment = segment_of(of.get());
  for (const auto& pad : pads)
    segment.stop = std::max(segment.stop, segment_of(pad.get()).stop);  // none is the maximum
  return segment;
}

GstSegment MergedTimeline::segment(const OwnedAggregatorPad& first,
                                   std::span<const OwnedAggregatorPad> pads) const {
  GstSegment segment = longest_segment(first, pads);
  const auto sought = sought_.copy();
  const auto has_reached = [&](const OwnedAggregatorPad& pad) {
    return GST_EVENT_MERGE_PAD(pad.get())->priv->segment_seqnum == sought->seqnum();
  };
  // Otherwise a further seek is on its way.
  if (!sought || std::ranges::none_of(pads, has_reached)) return segment;
  if (const auto begin = sought->start()) {
    segment.start = segment.position = timestamp_at(*begin);
    segment.time = static_cast<GstClockTime>(*begin);
  }
  if (const auto end = sought->stop(); end && *end >= 0) segment.stop = timestamp_at(*end);
  return segment;
}

/// Replaces the next seek with `seek` if they have the same sequence number.
static GstPadProbeReturn replace_seek(GstPad*, GstPadProbeInfo* info, gpointer seek) {
  GstEvent* const next = GST_PAD_PROBE_INFO_EVENT(info);
  if (GST_EVENT_TYPE(next) != GST_EVENT_SEEK) return GST_PAD_PROBE_OK;
  if (gst_event_get_seqnum(next) == gst_event_get_seqnum(GST_EVENT(seek)))
    gst_event_replace(reinterpret_cast<GstEvent**>(&info->data), GST_EVENT(seek));
  return GST_PAD_PROBE_REMOVE;
}

void MergedTimeline::seek(const SeekRequest& request) {
  const auto last = std::exchange(*sought_.lock(), request);
  if (last && last->seqnum() == request.seqnum()) return;  // a bin sends one to each of its sinks
  const auto zero = start();
  // gst_aggregator_event_forward_func() sends one event to the peer of each pad with
  // gst_pad_send_event(), past the probes of the pad itself, and calls no virtual function.
  for_each_sink_pad(element_, [&](GstAggregatorPad* pad) {
    const OwnedPad peer(gst_pad_get_peer(GST_PAD(pad)));
    if (!peer) return;
    OwnedEvent seek = request.in_later_stream(timestamp_in(pad, 0) - zero).event();
    gst_pad_add_probe(
        peer.get(), GST_PAD_PROBE_TYPE_EVENT_UPSTREAM, replace_seek, seek.release(),
        +[](gpointer event) { gst_event_unref(GST_EVENT(event)); });
  });
}

/// Duration up to the end of the last stream; none if no end is known.
std::optional<gint64> MergedTimeline::duration() const {
  const auto zero = start();
  std::optional<gint64> longest;
  for_each_sink_pad(element_, [&](GstAggregatorPad* pad) {
    gint64 duration = -1;
    if (gst_pad_peer_query_duration(GST_PAD(pad), GST_FORMAT_TIME, &duration) && duration >= 0)
      longest = std::max(longest.value_or(0), timestamp_in(pad, duration) - zero);
  });
  return longest;
}

gboolean MergedTimeline::answer_duration(GstQuery* query) const {
  const auto longest = duration();
  if (longest) gst_query_set_duration(query, GST_FORMAT_TIME, *longest);
  return longest ? TRUE : FALSE;
}

void MergedTimeline::extend_seeking(GstQuery* query) const {
  GstFormat format = GST_FORMAT_UNDEFINED;
  gboolean seekable = FALSE;
  gst_query_parse_seeking(query, &format, &seekable, nullptr, nullptr);
  const auto longest = duration();
  if (seekable && format == GST_FORMAT_TIME && longest)
    gst_query_set_seeking(query, format, TRUE, 0, *longest);
}
