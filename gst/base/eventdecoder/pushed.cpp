// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventdecoder/pushed.hpp"

#include <mutex>
#include <optional>
#include <span>
#include <utility>

#include "gst/base/eventdecoder/decoding.hpp"
#include "gst/base/eventdecoder/ending.hpp"
#include "gst/base/eventdecoder/event_file.hpp"
#include "gst/base/eventdecoder/intervals.hpp"
#include "gst/base/eventdecoder/output.hpp"
#include "gst/base/eventdecoder/state.hpp"
#include "gst/eventcamera/eventcamera.h"

namespace eventdecoder {

/// Hands out everything, where what comes next does not follow on it.
static GstFlowReturn drain(GstEventDecoder* self) {
  auto* priv = self->priv;
  if (!priv->state) return GST_FLOW_OK;
  State& state = *priv->state;
  GstFlowReturn result = GST_FLOW_OK;
  if (state.consumed && state.stopped == GST_FLOW_OK)
    result = priv->faults.guard([&] { return take_end(self); });
  forget_times(self);
  return result;
}

/// Upstream says that all before this time has come. May throw.
static GstFlowReturn take_time(GstEventDecoder* self, GstClockTime time) {
  State& state = *self->priv->state;
  if (!state.shift || time > G_MAXINT64) return GST_FLOW_OK;
  state.chunker.reach(static_cast<Microseconds>(time / GST_USECOND) - *state.shift);
  return hand_out(self);
}

static GstFlowReturn take_buffer(GstEventDecoder* self, GstBuffer* buffer) {
  auto* priv = self->priv;
  const bool timed = is_timed(self);
  if (timed && GST_BUFFER_IS_DISCONT(buffer)) {
    const GstFlowReturn drained = drain(self);
    if (drained != GST_FLOW_OK) return drained;
    priv->discontinuous = true;
  }
  GstMapInfo map;
  if (!gst_buffer_map(buffer, &map, GST_MAP_READ)) {
    GST_ELEMENT_ERROR(self, RESOURCE, READ, ("A buffer cannot be read."), (nullptr));
    return GST_FLOW_ERROR;
  }
  const GstFlowReturn result = priv->faults.guard([&] {
    if (!priv->state) begin(self);
    if (priv->state->stopped != GST_FLOW_OK) return priv->state->stopped;
    const std::span<const guint8> bytes(map.data, map.size);
    GstFlowReturn taken = GST_FLOW_OK;
    if (reads_files(self))
      collect(self, bytes);
    else
      taken = take_bytes(self, bytes, buffer);
    if (taken == GST_FLOW_OK && timed && GST_BUFFER_PTS_IS_VALID(buffer) &&
        GST_BUFFER_DURATION_IS_VALID(buffer))
      taken = take_time(self, GST_BUFFER_PTS(buffer) + GST_BUFFER_DURATION(buffer));
    return taken;
  });
  if (priv->state) priv->state->stopped = result;
  {
    const std::lock_guard lock(priv->mutex);
    priv->pushed_bytes += map.size;
  }
  gst_buffer_unmap(buffer, &map);
  return result;
}

GstFlowReturn chain(GstPad*, GstObject* parent, GstBuffer* buffer) {
  const GstFlowReturn result = take_buffer(GST_EVENT_DECODER(parent), buffer);
  gst_buffer_unref(buffer);
  return result;
}

/// Takes the event.
static gboolean send_in_order(GstEventDecoder* self, GstEvent* event) {
  auto* priv = self->priv;
  if (GST_EVENT_IS_SERIALIZED(event) && (!priv->caps_sent || priv->segment_due)) {
    priv->held.push_back(event);
    return TRUE;
  }
  return gst_pad_push_event(priv->src, event);
}

static gboolean take_caps(GstEventDecoder* self, GstEvent* event) {
  auto* priv = self->priv;
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  if (priv->caps && gst_caps_is_equal(priv->caps.get(), caps)) return TRUE;
  drain(self);
  {
    const std::lock_guard lock(priv->decoding);
    priv->state.reset();
  }
  priv->caps.reset(gst_caps_ref(caps));
  priv->caps_sent = false;
  return priv->faults.guard([&] {
    begin(self);
    return GST_FLOW_OK;
  }) == GST_FLOW_OK;
}

/// A file has its own times, whatever the segment that it comes in.
static bool carries_words(GstEventDecoder* self) {
  const auto& caps = self->priv->caps;
  return caps &&
         gst_structure_has_name(gst_caps_get_structure(caps.get(), 0), GST_EVENT_CAMERA_MEDIA_TYPE);
}

/// Takes the event.
static gboolean take_segment(GstEventDecoder* self, GstEvent* event) {
  auto* priv = self->priv;
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  drain(self);
  std::optional<Restart> restart;
  const bool timed = segment->format == GST_FORMAT_TIME && carries_words(self);
  const guint64 start = segment->start;
  {
    const std::lock_guard lock(priv->mutex);
    priv->timed = timed;
    priv->pushed_bytes = segment->format == GST_FORMAT_BYTES ? start : 0;
    restart = std::exchange(priv->restart, std::nullopt);
  }
  if (timed) {
    priv->segment_due = false;
    return send_in_order(self, event);
  }
  gst_event_unref(event);
  return priv->faults.guard([&] {
    if (restart && restart->seek_point.value_or(SeekPoint{}).position == start) {
      if (!priv->state) begin(self);
      restart_at(self, *restart);
    } else {
      begin(self);  // another file
      priv->segment_due = true;
      const std::lock_guard lock(priv->mutex);
      priv->first.reset();
      priv->duration = GST_CLOCK_TIME_NONE;
      gst_segment_init(&priv->segment, GST_FORMAT_TIME);
    }
    return GST_FLOW_OK;
  }) == GST_FLOW_OK;
}

/// Takes the event.
static gboolean take_gap(GstEventDecoder* self, GstEvent* event) {
  auto* priv = self->priv;
  GstClockTime pts = GST_CLOCK_TIME_NONE;
  GstClockTime duration = GST_CLOCK_TIME_NONE;
  gst_event_parse_gap(event, &pts, &duration);
  const GstFlowReturn result = priv->faults.guard([&] {
    if (!is_timed(self) || !priv->state || !GST_CLOCK_TIME_IS_VALID(duration)) return GST_FLOW_OK;
    if (priv->state->chunker.first()) return take_time(self, pts + duration);
    const GstFlowReturn begun = begin_output(self);
    if (begun == GST_FLOW_OK) gst_pad_push_event(priv->src, gst_event_ref(event));
    return begun;
  });
  gst_event_unref(event);
  return result == GST_FLOW_OK;
}

gboolean sink_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  auto* self = GST_EVENT_DECODER(parent);
  auto* priv = self->priv;
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_STREAM_START:
      gst_event_replace(&priv->stream_start, event);
      priv->stream_started = false;
      gst_event_unref(event);
      return TRUE;
    case GST_EVENT_CAPS: {
      const gboolean taken = take_caps(self, event);
      gst_event_unref(event);
      return taken;
    }
    case GST_EVENT_SEGMENT:
      return take_segment(self, event);
    case GST_EVENT_GAP:
      return take_gap(self, event);
    case GST_EVENT_EOS:
      priv->faults.guard([&] {
        if (!priv->state) begin(self);
        return priv->state->stopped == GST_FLOW_OK ? take_end(self) : GST_FLOW_OK;
      });
      return gst_pad_push_event(priv->src, event);
    case GST_EVENT_FLUSH_STOP:
      drop_held(self);
      if (priv->state) forget_times(self);
      priv->discontinuous = true;
      return gst_pad_push_event(priv->src, event);
    default:
      if (GST_EVENT_IS_SERIALIZED(event)) return send_in_order(self, event);
      return gst_pad_event_default(pad, parent, event);
  }
}

}  // namespace eventdecoder
