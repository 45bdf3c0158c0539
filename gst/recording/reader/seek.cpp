// SPDX-License-Identifier: LGPL-2.1-or-later
/// Seeks in pull mode and in push mode.
#include "gst/base/pads.hpp"
#include "gst/recording/reader/event_reader.hpp"

#define GST_CAT_DEFAULT event_reader_debug

using eventcamera::RecordingReader;
using eventcamera::SeekPoint;

gboolean EventReader::src_event(GstPad* pad, GstEvent* event) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_SEEK || is_timed())
    return gst_pad_event_default(pad, GST_OBJECT(element_), event);
  const bool done = seek(event);
  gst_event_unref(event);
  return done;
}

bool EventReader::can_seek() {
  return shared_.lock()->is_pulling || peer_can_seek(sink_, GST_FORMAT_BYTES);
}

/// Duration that ends a segment. If it is an estimate, it may be too short, and only serves to
/// count from the end.
GstClockTime EventReader::limit_of(const SeekRequest& request) {
  if (request.counts_from_end()) return duration();
  const auto shared = shared_.lock();
  return shared->is_duration_exact ? shared->duration : GST_CLOCK_TIME_NONE;
}

bool EventReader::seek(GstEvent* event) {
  const SeekRequest request(event);
  if (!request.plays_on_from_time() || !can_seek()) {
    GST_INFO_OBJECT(element_, "refused to seek at rate %g in %s", request.rate(),
                    gst_format_get_name(request.format()));
    return false;
  }
  const GstClockTime limit = limit_of(request);
  if (request.counts_from_end() && !GST_CLOCK_TIME_IS_VALID(limit)) {
    GST_INFO_OBJECT(element_, "refused to seek from the end: it is not known yet");
    return false;
  }
  Restart restart;
  bool is_pulling = false;
  std::shared_ptr<RecordingReader> recording;
  {
    const auto shared = shared_.lock();
    // A bin sends a seek to each of its sinks, so the same seek may arrive on every source pad.
    if (shared->last_seek == request.seqnum()) return true;
    is_pulling = shared->is_pulling;
    recording = shared->recording;
    restart.segment = shared->segment;
    restart.segment.duration = limit;
  }
  if (!request.apply(restart.segment)) return false;
  restart.seqnum = request.seqnum();
  if (!is_pulling && !request.flushes()) return false;
  if (!is_pulling && recording)
    restart.seek_point = recording->seek_point_before(position_of(restart.segment));
  GST_DEBUG_OBJECT(element_,
                   "seek in %s mode to %" GST_TIME_FORMAT ", from byte %" G_GUINT64_FORMAT
                   " on: %" GST_SEGMENT_FORMAT,
                   is_pulling ? "pull" : "push", GST_TIME_ARGS(restart.segment.position),
                   guint64{restart.seek_point.value_or(SeekPoint{}).position}, &restart.segment);
  const bool done = is_pulling ? seek_pulling(request) : seek_pushed(restart, request.rate());
  if (done) shared_.lock()->last_seek = request.seqnum();
  return done;
}

bool EventReader::seek_pulling(const SeekRequest& request) {
  // The streaming thread may add pads concurrently, so iterate safely.
  const auto send_all = [&](GstEvent* event) {
    gst_event_set_seqnum(event, request.seqnum());
    gst_pad_push_event(sink_, gst_event_ref(event));
    gst_element_foreach_src_pad(
        element_,
        +[](GstElement*, GstPad* pad, gpointer sent) -> gboolean {
          gst_pad_push_event(pad, gst_event_ref(static_cast<GstEvent*>(sent)));
          return TRUE;
        },
        event);
    gst_event_unref(event);
  };
  if (request.flushes())
    send_all(gst_event_new_flush_start());
  else
    gst_pad_pause_task(sink_);
  GST_PAD_STREAM_LOCK(sink_);
  if (request.flushes()) send_all(gst_event_new_flush_stop(TRUE));
  const GstClockTime limit = limit_of(request);
  GstSegment segment;
  {
    const auto shared = shared_.lock();
    shared->segment.duration = limit;
    request.apply(shared->segment);  // from the position at which output has stopped
    shared->counts = {};
    segment = shared->segment;
  }
  seqnum_ = request.seqnum();
  corrupt_places_ = 0;
  gst_flow_combiner_reset(combiner_);
  interrupt_output();
  const GstFlowReturn result = guard([&] {
    if (bytes_) bytes_->retry();
    if (recording_) recording_->seek(position_of(segment), stop_of(segment));
    return GST_FLOW_OK;
  });
  if (result == GST_FLOW_OK) post_segment_start();
  if (shared_.lock()->is_pulling) gst_pad_start_task(sink_, loop, this, nullptr);
  GST_PAD_STREAM_UNLOCK(sink_);
  return result == GST_FLOW_OK;
}

/// Forwards a seek as a seek in bytes. Upstream flushes and sends a BYTES segment, which completes
/// the seek.
bool EventReader::seek_pushed(Restart restart, gdouble rate) {
  GstEvent* const event = with_seqnum(
      gst_event_new_seek(rate, GST_FORMAT_BYTES, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET,
                         static_cast<gint64>(restart.seek_point.value_or(SeekPoint{}).position),
                         GST_SEEK_TYPE_NONE, -1),
      restart.seqnum);
  {
    const auto shared = shared_.lock();
    if (shared->restart) restart.superseded = shared->restart->seqnum;
    shared->restart = restart;
  }
  if (gst_pad_push_event(sink_, event)) return true;
  shared_.lock()->restart.reset();
  return false;
}
