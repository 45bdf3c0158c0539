// SPDX-License-Identifier: LGPL-2.1-or-later
/// Push mode: upstream sends the bytes of a file, or words with its own times.
#include <utility>

#include "gst/base/buffer_bytes.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/played_segment.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "gst/recording/reader/event_reader.hpp"

#define GST_CAT_DEFAULT event_reader_debug

using eventcamera::Microseconds;
using eventcamera::RecordingReader;
using eventcamera::SeekPoint;

GstFlowReturn EventReader::chain(GstBuffer* buffer) {
  const OwnedBuffer owner(buffer);
  if (is_timed() && GST_BUFFER_IS_DISCONT(buffer)) {
    const GstFlowReturn drained = drain();
    if (recording_) recording_->interrupt();
    for (auto& pad : pads_) {
      pad->interrupt();
      pad->need_segment(false);
    }
    if (drained != GST_FLOW_OK) return drained;
  }
  if (flow_ != GST_FLOW_OK) return flow_;
  flow_ = guard([&] { return handle_buffer(buffer); });
  if (flow_ == GST_FLOW_NOT_LINKED)  // upstream may have others to feed
    post_message(element_, GST_MESSAGE_WARNING, not_linked(), "all source pads are not linked");
  return flow_;
}

/// May throw.
GstFlowReturn EventReader::handle_buffer(GstBuffer* buffer) {
  const MappedBytes bytes(element_, OwnedBuffer(gst_buffer_ref(buffer)));
  if (!bytes.is_mapped()) return GST_FLOW_ERROR;
  if (!recording_) open_recording();
  is_consuming_ = true;
  std::optional<RecordingReader::Interval> interval;
  const bool has_end = GST_BUFFER_DURATION_IS_VALID(buffer);
  if (is_timed() && GST_BUFFER_PTS_IS_VALID(buffer))
    interval = {static_cast<Microseconds>(GST_BUFFER_PTS(buffer) / GST_USECOND),
                has_end ? static_cast<Microseconds>(GST_BUFFER_DURATION(buffer) / GST_USECOND) : 0};
  recording_->push(bytes.get(), interval);
  GstFlowReturn result = push_pending();
  if (result == GST_FLOW_OK && interval && has_end)
    result = handle_interval_end(static_cast<Microseconds>(
        (GST_BUFFER_PTS(buffer) + GST_BUFFER_DURATION(buffer)) / GST_USECOND));
  if (result != GST_FLOW_OK) {
    try {
      recording_->discard();
    } catch (const std::exception& error) {
      GST_DEBUG_OBJECT(element_, "dropped bytes cannot be read: %s", error.what());
    }
  }
  shared_.lock()->pushed_bytes += bytes.get().size();
  return result;
}

/// Handles the end of an upstream interval: nothing earlier will follow. May throw.
GstFlowReturn EventReader::handle_interval_end(Microseconds end) {
  recording_->advance_to(end);
  return push_pending();
}

/// Pushes all available output. May throw.
GstFlowReturn EventReader::push_pending() {
  GstFlowReturn result = GST_FLOW_OK;
  while (result == GST_FLOW_OK) result = step();
  if (result != nothing_ready) return result;
  if (!recording_->is_past_stop()) return GST_FLOW_OK;
  result = output_due_ ? begin_output() : GST_FLOW_OK;
  return result == GST_FLOW_OK ? GST_FLOW_EOS : result;
}

gboolean EventReader::sink_event(GstEvent* event) {
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_STREAM_START:
      drain();  // into the stream that ends here, before the new one
      if (recording_ && is_timed()) recording_->interrupt();
      gst_event_replace(&stream_start_, event);
      gst_event_unref(event);
      for (auto& pad : pads_) pad->reset();
      group_ = GST_GROUP_ID_INVALID;
      output_due_ = true;
      return TRUE;
    case GST_EVENT_CAPS:
      return handle_caps(event);
    case GST_EVENT_SEGMENT:
      return handle_segment(event);
    case GST_EVENT_GAP:
      handle_gap(event);
      return TRUE;
    case GST_EVENT_EOS:
      seqnum_ = gst_event_get_seqnum(event);
      gst_event_unref(event);
      finish_input();
      is_consuming_ = false;
      end_output(flow_ != GST_FLOW_OK && flow_ != GST_FLOW_EOS);
      return TRUE;
    case GST_EVENT_FLUSH_STOP:
      for (GstEvent* held : std::exchange(held_, {})) gst_event_unref(held);
      if (recording_ && is_timed()) recording_->interrupt();
      is_consuming_ = false;
      flow_ = GST_FLOW_OK;
      gst_flow_combiner_reset(combiner_);
      interrupt_output();
      return gst_pad_event_default(sink_, GST_OBJECT(element_), event);
    default:
      return is_serialized(event) ? forward(event)
                                  : gst_pad_event_default(sink_, GST_OBJECT(element_), event);
  }
}

/// Forwards an event in order. Takes ownership of `event`.
gboolean EventReader::forward(GstEvent* event) {
  if (output_due_)
    held_.push_back(event);
  else
    push_to_pads(event);
  return TRUE;
}

/// Pushes all pending output before a discontinuity.
GstFlowReturn EventReader::drain() {
  if (is_consuming_) finish_input();
  if (recording_) recording_->begin_times();
  is_consuming_ = false;
  return std::exchange(flow_, GST_FLOW_OK);
}

void EventReader::finish_input() {
  if (flow_ != GST_FLOW_OK) return;
  flow_ = guard([&] {
    if (!recording_) open_recording();
    recording_->finish();
    GstFlowReturn result = push_pending();
    if (result == GST_FLOW_OK && output_due_) result = begin_output();
    if (!is_timed()) update_duration();
    warn_if_empty();
    warn_of_dropped();
    return result;
  });
}

gboolean EventReader::handle_caps(GstEvent* event) {
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  const bool is_new = !caps_ || !gst_caps_is_equal(caps_.get(), caps);
  if (is_new) {
    drain();
    close_recording();
    caps_.reset(gst_caps_ref(caps));
  }
  gst_event_unref(event);
  return TRUE;
}

/// True for words without a header; files have their own times, whatever their segment.
bool EventReader::carries_words() const {
  return caps_ && gst_structure_has_name(gst_caps_get_structure(caps_.get(), 0),
                                         GST_EVENT_CAMERA_MEDIA_TYPE);
}

/// Takes ownership of `event`.
gboolean EventReader::handle_segment(GstEvent* event) {
  drain();
  if (!plays_forwards(element_, event, "read")) return FALSE;
  const GstSegment segment = segment_of(event);
  const bool timed = segment.format == GST_FORMAT_TIME && carries_words();
  const guint64 start = segment.start;
  bool was_timed = false;
  std::optional<Restart> restart;
  {
    const auto shared = shared_.lock();
    was_timed = std::exchange(shared->is_timed, timed);
    shared->pushed_bytes = segment.format == GST_FORMAT_BYTES ? start : 0;
    restart = shared->restart;
  }
  if (timed) {
    if (!was_timed) close_recording();
    for (auto& pad : pads_) pad->need_segment(false);
    return forward(event);
  }
  const guint32 seqnum = gst_event_get_seqnum(event);
  gst_event_unref(event);
  const bool is_sought = restart && restart->seek_point.value_or(SeekPoint{}).position == start &&
                         seqnum != restart->superseded;
  if (restart && !is_sought && seqnum != restart->seqnum) {
    // The segment belongs to an earlier seek; the pending one will flush what follows.
    flow_ = GST_FLOW_FLUSHING;
    return TRUE;
  }
  shared_.lock()->restart.reset();
  interrupt_output();
  // A seek point is useless for a recording that was closed meanwhile.
  if (!is_sought || (restart->seek_point && !recording_)) {
    close_recording();  // another file
    seqnum_ = seqnum;
    const auto shared = shared_.lock();
    shared->duration = GST_CLOCK_TIME_NONE;
    gst_segment_init(&shared->segment, GST_FORMAT_TIME);
    return TRUE;
  }
  {
    const auto shared = shared_.lock();
    shared->segment = restart->segment;
    shared->counts = {};
  }
  seqnum_ = restart->seqnum;
  post_segment_start();
  corrupt_places_ = 0;
  return guard([&] {
           if (!recording_) open_recording();
           recording_->restart(restart->seek_point, position_of(restart->segment),
                               stop_of(restart->segment));
           return GST_FLOW_OK;
         }) == GST_FLOW_OK;
}

/// Takes ownership of `event`.
void EventReader::handle_gap(GstEvent* event) {
  GstClockTime pts = GST_CLOCK_TIME_NONE;
  GstClockTime duration = GST_CLOCK_TIME_NONE;
  gst_event_parse_gap(event, &pts, &duration);
  const bool is_known = GST_CLOCK_TIME_IS_VALID(duration) && is_timed() && flow_ == GST_FLOW_OK;
  if (is_known)
    flow_ = guard([&] {
      if (!recording_) open_recording();
      recording_->advance_to(static_cast<Microseconds>((pts + duration) / GST_USECOND));
      if (recording_->has_events()) return push_pending();
      GstFlowReturn result = push_pending();
      if (result == GST_FLOW_OK && output_due_) result = begin_output();
      if (result == GST_FLOW_OK) push_to_pads(gst_event_ref(event));
      return result;
    });
  gst_event_unref(event);
}
