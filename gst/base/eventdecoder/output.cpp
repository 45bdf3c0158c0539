// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventdecoder/output.hpp"

#include <algorithm>
#include <mutex>
#include <span>
#include <utility>

#include "gst/base/copied_buffer.hpp"
#include "gst/base/eventdecoder/state.hpp"
#include "gst/base/file_streams.hpp"
#include "gst/base/owned.hpp"

namespace eventdecoder {

/// From the decoder's time to that of the PTS.
static Microseconds shift_of(GstEventDecoder* self) {
  auto* priv = self->priv;
  if (priv->state->shift) return *priv->state->shift;
  const std::lock_guard lock(priv->mutex);
  return priv->first && *priv->first < 0 ? -*priv->first : 0;
}

static GstClockTime pts_of(GstEventDecoder* self, Microseconds t) {
  return static_cast<GstClockTime>(std::max<Microseconds>(t + shift_of(self), 0)) * GST_USECOND;
}

/// The sensor's size: the file's, or what downstream insists on, or what the events fit into.
static SensorSize size_of_stream(GstEventDecoder* self) {
  State& state = *self->priv->state;
  auto size = state.told_size();
  if (size.width > 0 && size.height > 0) return size;
  if (!state.assumed) {
    OwnedCaps templ(gst_pad_get_pad_template_caps(self->priv->src));
    const OwnedCaps peer(gst_pad_peer_query_caps(self->priv->src, templ.get()));
    if (gst_caps_is_empty(peer.get()) ||
        !gst_structure_get_int(gst_caps_get_structure(peer.get(), 0), "width", &size.width) ||
        !gst_structure_get_int(gst_caps_get_structure(peer.get(), 0), "height", &size.height))
      size = state.used.sensor();
    GST_INFO_OBJECT(self, "the size is not told; %dx%d is assumed", size.width, size.height);
    state.assumed = size;
  }
  return *state.assumed;
}

static bool send_caps(GstEventDecoder* self) {
  const OwnedCaps caps(file_events_caps(size_of_stream(self)));
  return push_stream_caps(self->priv->src, caps.get());
}

static void send_segment(GstEventDecoder* self) {
  auto* priv = self->priv;
  GstSegment segment;
  {
    const std::lock_guard lock(priv->mutex);
    if (priv->timed) return;  // upstream's own is among what was held
    priv->segment.duration = priv->duration;
    const auto first = std::max<Microseconds>(priv->first.value_or(0), 0);
    segment = segment_from(static_cast<GstClockTime>(first) * GST_USECOND, priv->segment);
  }
  gst_pad_push_event(priv->src, with_seqnum(gst_event_new_segment(&segment), priv->seqnum));
}

/// Sends what a stream begins with. The source pad appears with it: who plugs elements, as
/// decodebin does, so has it before there is data.
static void start_stream(GstEventDecoder* self) {
  auto* priv = self->priv;
  GstEvent* event = std::exchange(priv->stream_start, nullptr);
  const bool of_file = !is_timed(self) || event == nullptr;
  if (of_file) {
    const guint group = group_of_streams(event);
    gst_clear_event(&event);
    event = file_stream_start(GST_ELEMENT(self), priv->src, nullptr, group);
  }
  const bool added = GST_OBJECT_PARENT(priv->src) != nullptr;
  if (!added) gst_pad_set_active(priv->src, TRUE);
  gst_pad_push_event(priv->src, event);
  if (of_file) announce_streams(GST_ELEMENT(self), std::span(&priv->src, 1));
  if (added) return;
  gst_element_add_pad(GST_ELEMENT(self), priv->src);
  gst_element_no_more_pads(GST_ELEMENT(self));
}

GstFlowReturn begin_output(GstEventDecoder* self) {
  auto* priv = self->priv;
  if (!std::exchange(priv->stream_started, true)) start_stream(self);
  if (!priv->caps_sent) {
    if (!send_caps(self)) {
      const GstFlowReturn last = gst_pad_get_last_flow_return(priv->src);
      return last == GST_FLOW_FLUSHING ? last : GST_FLOW_NOT_NEGOTIATED;
    }
    priv->caps_sent = true;
  }
  if (std::exchange(priv->segment_due, false)) send_segment(self);
  for (GstEvent* event : std::exchange(priv->held, {})) gst_pad_push_event(priv->src, event);
  return GST_FLOW_OK;
}

GstFlowReturn push_interval(GstEventDecoder* self, const Chunker::Interval& interval) {
  auto* priv = self->priv;
  if (!priv->caps_sent || priv->segment_due || !priv->held.empty()) {
    {
      const std::lock_guard lock(priv->mutex);
      if (!priv->first) priv->first = priv->state->chunker.first();
    }
    const GstFlowReturn result = begin_output(self);
    if (result != GST_FLOW_OK) return result;
  }
  const GstClockTime pts = pts_of(self, interval.start);
  const GstClockTime duration = static_cast<GstClockTime>(interval.duration) * GST_USECOND;
  {
    const std::lock_guard lock(priv->mutex);
    const auto begun = static_cast<GstClockTime>(interval.start - priv->first.value_or(0));
    const GstClockTime position = begun * GST_USECOND;
    if (!priv->timed && GST_CLOCK_TIME_IS_VALID(priv->segment.stop) &&
        position >= priv->segment.stop)
      return GST_FLOW_EOS;
    priv->segment.position = position + duration;
    priv->counts.events += interval.events.size();
  }
  if (interval.events.empty())
    return gst_pad_push_event(priv->src, gst_event_new_gap(pts, duration))
               ? GST_FLOW_OK
               : gst_pad_get_last_flow_return(priv->src);

  GstBuffer* buffer = copied_buffer(std::as_bytes(interval.events));
  GST_BUFFER_PTS(buffer) = pts;
  GST_BUFFER_DURATION(buffer) = duration;
  if (std::exchange(priv->discontinuous, false))
    GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_DISCONT);
  return gst_pad_push(priv->src, buffer);
}

}  // namespace eventdecoder
