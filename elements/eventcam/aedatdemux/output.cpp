// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/aedatdemux/output.hpp"

#include <algorithm>
#include <mutex>
#include <span>
#include <utility>

#include "elements/eventcam/aedatdemux/pads.hpp"
#include "elements/eventcam/aedatdemux/state.hpp"
#include "gst/base/copied_buffer.hpp"
#include "gst/base/file_streams.hpp"
#include "gst/base/owned.hpp"

namespace aedatdemux {

/// A stream that is further behind the others is silent.
constexpr GstClockTime max_lag = 500 * GST_MSECOND;

static GstFlowReturn combined(GstAedatDemux* self, const Stream& stream, GstFlowReturn result) {
  return gst_flow_combiner_update_pad_flow(self->priv->combiner, stream.pad, result);
}

/// Notes that a stream was handed out until `end`. False where `start` is beyond the segment.
static bool advance(GstAedatDemux* self, Stream& stream, GstClockTime start, GstClockTime end) {
  State& state = self->priv->state;
  stream.position = std::max(stream.position, end);
  state.newest = std::max(state.newest, end);
  const std::lock_guard lock(self->priv->mutex);
  auto& segment = self->priv->segment;
  segment.position = std::max(segment.start, state.newest);
  return !GST_CLOCK_TIME_IS_VALID(segment.stop) || start < segment.stop;
}

/// Tells of silence.
static GstFlowReturn push_gap(GstAedatDemux* self, Stream& stream, GstClockTime start,
                              GstClockTime end) {
  send_segment(self, stream);
  const GstClockTime pts = pts_of(self->priv->state, start);
  const bool taken = gst_pad_push_event(stream.pad, gst_event_new_gap(pts, end - start)) != FALSE;
  return combined(self, stream, taken ? GST_FLOW_OK : gst_pad_get_last_flow_return(stream.pad));
}

static GstFlowReturn push_buffer(GstAedatDemux* self, Stream& stream, OwnedBuffer buffer,
                                 GstClockTime time) {
  send_segment(self, stream);
  GST_BUFFER_PTS(buffer.get()) = pts_of(self->priv->state, time);
  if (std::exchange(stream.discontinuous, false))
    GST_BUFFER_FLAG_SET(buffer.get(), GST_BUFFER_FLAG_DISCONT);
  return combined(self, stream, gst_pad_push(stream.pad, buffer.release()));
}

static GstFlowReturn push_interval(GstAedatDemux* self, Stream& stream,
                                   const Chunker::Interval& interval) {
  State& state = self->priv->state;
  const auto start = static_cast<GstClockTime>(interval.start - state.zero) * GST_USECOND;
  const auto end = start + static_cast<GstClockTime>(interval.duration) * GST_USECOND;
  if (!advance(self, stream, start, end)) return GST_FLOW_OK;
  state.counts.events += interval.events.size();
  if (interval.events.empty()) return push_gap(self, stream, start, end);
  OwnedBuffer buffer(copied_buffer(std::as_bytes(interval.events)));
  GST_BUFFER_DURATION(buffer.get()) = end - start;
  return push_buffer(self, stream, std::move(buffer), start);
}

GstFlowReturn push_intervals(GstAedatDemux* self, Stream& stream) {
  GstFlowReturn result = GST_FLOW_OK;
  while (result == GST_FLOW_OK) {
    const auto interval = stream.chunker.next();
    if (!interval) break;
    result = push_interval(self, stream, *interval);
  }
  return result;
}

GstFlowReturn catch_up(GstAedatDemux* self) {
  State& state = self->priv->state;
  if (state.newest < max_lag) return GST_FLOW_OK;
  const GstClockTime silent_until = state.newest - max_lag;
  GstFlowReturn result = GST_FLOW_OK;
  for (auto& stream : state.streams) {
    if (stream.pad == nullptr || stream.position >= silent_until) continue;
    if (stream.kind == Aedat4Kind::events) {
      stream.chunker.reach(state.zero + static_cast<Microseconds>(silent_until / GST_USECOND));
      result = push_intervals(self, stream);
    } else if (silent_until - stream.position >= max_lag) {
      const GstClockTime start = stream.position;
      if (advance(self, stream, start, silent_until))
        result = push_gap(self, stream, start, silent_until);
    }
    if (result != GST_FLOW_OK) return result;
  }
  const std::lock_guard lock(self->priv->mutex);
  const auto stop = self->priv->segment.stop;
  return GST_CLOCK_TIME_IS_VALID(stop) && silent_until >= stop ? GST_FLOW_EOS : GST_FLOW_OK;
}

GstFlowReturn put_out(GstAedatDemux* self, std::size_t index,
                      std::span<const AbsoluteEvent> events) {
  State& state = self->priv->state;
  Stream& stream = state.streams[index];
  if (stream.size_assumed) {
    state.within.assign(events.begin(), events.end());
    state.counts.outside += eventcamera::erase_outside(state.within, stream.size);
    events = state.within;
  }
  stream.chunker.push(events);
  return push_intervals(self, stream);
}

GstFlowReturn put_out(GstAedatDemux* self, std::size_t index, Frame frame) {
  State& state = self->priv->state;
  Stream& stream = state.streams[index];
  if (frame.t < state.zero) {
    ++state.counts.untimely;
    return GST_FLOW_OK;
  }
  const auto time = static_cast<GstClockTime>(frame.t - state.zero) * GST_USECOND;
  if (frame.t < output_start(self) || !advance(self, stream, time, time)) return GST_FLOW_OK;
  if (!stream.video || !gst_video_info_is_equal(&*stream.video, &frame.info)) {
    stream.video = frame.info;
    if (!send_caps(stream) && GST_PAD_IS_FLUSHING(stream.pad)) return GST_FLOW_FLUSHING;
  }
  ++state.counts.frames;
  return push_buffer(self, stream, std::move(frame.buffer), time);
}

void end_streams(GstAedatDemux* self) {
  GstSegment segment;
  {
    const std::lock_guard lock(self->priv->mutex);
    segment = self->priv->segment;
  }
  GstEvent* const end = end_of_streams(GST_ELEMENT(self), segment, self->priv->seqnum);
  for (auto& stream : self->priv->state.streams) {
    if (stream.pad == nullptr) continue;
    send_segment(self, stream);
    gst_pad_push_event(stream.pad, gst_event_ref(end));
  }
  gst_event_unref(end);
}

}  // namespace aedatdemux
