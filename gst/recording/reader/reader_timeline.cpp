// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/reader/reader_timeline.hpp"

#include <utility>

#include "gst/base/pads.hpp"

using namespace eventcamera;

void ReaderTimeline::reset() {
  const auto state = state_.lock();
  const bool is_pulling = state->is_pulling;
  *state = {};
  state->is_pulling = is_pulling;
}

void ReaderTimeline::forget_file() {
  const auto state = state_.lock();
  state->duration = GST_CLOCK_TIME_NONE;
  gst_segment_init(&state->segment, GST_FORMAT_TIME);
}

void ReaderTimeline::begin_bytes(bool is_timed, guint64 position) {
  const auto state = state_.lock();
  state->is_timed = is_timed;
  state->pushed_bytes = position;
}

void ReaderTimeline::set_recording(Recording recording) {
  const auto state = state_.lock();
  state->recording.swap(recording);  // the old one is freed after the lock
}

GstSegment ReaderTimeline::segment() {
  const auto state = state_.lock();
  GstSegment segment = state->segment;
  segment.duration = state->duration;
  return segment;
}

void ReaderTimeline::advance_to(GstClockTime position) {
  const auto state = state_.lock();
  if (!state->is_timed) state->segment.position = std::max(state->segment.position, position);
}

/// None once all bytes are received: formats that are decoded as a whole have output little by
/// then.
GstClockTime ReaderTimeline::duration() {
  guint64 pushed = 0;
  GstClockTime position = 0;
  {
    const auto state = state_.lock();
    if (GST_CLOCK_TIME_IS_VALID(state->duration) || state->is_pulling) return state->duration;
    pushed = state->pushed_bytes;
    position = state->segment.position;
  }
  const guint64 size = upstream_bytes(sink_);
  if (pushed == 0 || pushed >= size || position == 0) return GST_CLOCK_TIME_NONE;
  return gst_util_uint64_scale(position, size, pushed);
}

void ReaderTimeline::update_duration(const RecordingReader& recording) {
  const auto length = recording.duration();
  if (!length) return;
  const auto duration = nanoseconds(*length);
  GstClockTime before = GST_CLOCK_TIME_NONE;
  {
    const auto state = state_.lock();
    state->is_duration_exact = recording.is_duration_exact();
    before = std::exchange(state->duration, duration);
  }
  auto* const element = GST_PAD_PARENT(sink_);
  if (before != duration)
    gst_element_post_message(element, gst_message_new_duration_changed(GST_OBJECT(element)));
}

gboolean ReaderTimeline::answer(GstPad* src, GstQuery* query) {
  GstFormat format = GST_FORMAT_UNDEFINED;
  switch (GST_QUERY_TYPE(query)) {
    case GST_QUERY_POSITION:
      gst_query_parse_position(query, &format, nullptr);
      if (format != GST_FORMAT_TIME) return FALSE;
      gst_query_set_position(query, format, static_cast<gint64>(segment().position));
      return TRUE;
    case GST_QUERY_DURATION: {
      gst_query_parse_duration(query, &format, nullptr);
      if (format != GST_FORMAT_TIME) return FALSE;
      const GstClockTime length = duration();
      if (!GST_CLOCK_TIME_IS_VALID(length)) return FALSE;
      gst_query_set_duration(query, format, static_cast<gint64>(length));
      return TRUE;
    }
    case GST_QUERY_SEEKING:
      gst_query_parse_seeking(query, &format, nullptr, nullptr, nullptr);
      if (format != GST_FORMAT_TIME) return FALSE;
      gst_query_set_seeking(query, format, can_seek(), 0, static_cast<gint64>(duration()));
      return TRUE;
    case GST_QUERY_SEGMENT: {
      const auto played = segment();
      const auto stop = GST_CLOCK_TIME_IS_VALID(played.stop) ? played.stop : duration();
      gst_query_set_segment(query, played.rate, GST_FORMAT_TIME, static_cast<gint64>(played.start),
                            static_cast<gint64>(stop));
      return TRUE;
    }
    default:
      return gst_pad_query_default(src, GST_OBJECT_PARENT(src), query);
  }
}

bool ReaderTimeline::can_seek() {
  return is_pulling() || peer_can_seek(sink_, GST_FORMAT_BYTES);
}

/// An estimated duration may be too short, so it only serves to count from the end.
std::optional<GstSegment> ReaderTimeline::segment_after(const SeekRequest& request) {
  const GstClockTime counted = request.counts_from_end() ? duration() : GST_CLOCK_TIME_NONE;
  GstSegment segment;
  {
    const auto state = state_.lock();
    segment = state->segment;
    segment.duration = request.counts_from_end()  ? counted
                       : state->is_duration_exact ? state->duration
                                                  : GST_CLOCK_TIME_NONE;
  }
  return request.apply(segment) ? std::optional(segment) : std::nullopt;
}

ReaderTimeline::Restart ReaderTimeline::begin_restart(const SeekRequest& request,
                                                      const GstSegment& segment) {
  Restart restart{.segment = segment, .seek_point = {}, .seqnum = request.seqnum()};
  Recording recording;
  {
    const auto state = state_.lock();
    if (!state->is_compressed) recording = state->recording;
  }
  if (recording) restart.seek_point = recording->seek_point_before(position_of(segment));
  const auto state = state_.lock();
  if (state->restart) restart.superseded = state->restart->seqnum;
  state->restart = restart;
  return restart;
}
