// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/seek_request.hpp"

#include "gst/base/pads.hpp"

SeekRequest::SeekRequest(GstEvent* event) : seqnum_(gst_event_get_seqnum(event)) {
  gst_event_parse_seek(event, &rate_, &format_, &flags_, &start_type_, &start_, &stop_type_,
                       &stop_);
}

namespace {

/// Start or stop of a segment after a seek.
struct Edge {
  GstSeekType type;  ///< GST_SEEK_TYPE_SET, or GST_SEEK_TYPE_NONE if it stays
  guint64 position;  ///< within the duration, if that is known
};

/// `unset` is the position that -1 means.
Edge edge_of(GstSeekType type, gint64 asked, guint64 kept, guint64 unset, guint64 duration) {
  const bool has_duration = GST_CLOCK_TIME_IS_VALID(duration);
  const auto distance =
      asked < 0 ? guint64{0} - static_cast<guint64>(asked) : static_cast<guint64>(asked);
  Edge edge{GST_SEEK_TYPE_SET, kept};
  if (type == GST_SEEK_TYPE_SET)
    edge.position = asked < 0 ? unset : distance;
  else if (type == GST_SEEK_TYPE_END && has_duration)
    edge.position = asked < 0 ? duration - std::min(duration, distance) : duration;
  else
    edge.type = GST_SEEK_TYPE_NONE;
  if (has_duration && GST_CLOCK_TIME_IS_VALID(edge.position))
    edge.position = std::min(edge.position, duration);
  return edge;
}

}  // namespace

bool SeekRequest::apply(GstSegment& segment) const {
  const auto start = edge_of(start_type_, start_, segment.start, 0, segment.duration);
  const auto stop = edge_of(stop_type_, stop_, segment.stop, GST_CLOCK_TIME_NONE, segment.duration);
  // gst_segment_do_seek() asserts this. GST_CLOCK_TIME_NONE (no stop) is the largest value.
  if (start.position > stop.position) return false;
  return gst_segment_do_seek(&segment, rate_, format_, flags_, start.type, start.position,
                             stop.type, stop.position, nullptr) != FALSE;
}

SeekRequest SeekRequest::from_start(gint64 duration) const {
  SeekRequest request = *this;
  const auto count = [duration](GstSeekType& type, gint64& position) {
    if (type != GST_SEEK_TYPE_END) return;
    type = GST_SEEK_TYPE_SET;
    position = position < 0 ? std::max<gint64>(duration + position, 0) : duration;
  };
  count(request.start_type_, request.start_);
  count(request.stop_type_, request.stop_);
  return request;
}

SeekRequest SeekRequest::in_later_stream(gint64 delay) const {
  SeekRequest request = *this;
  if (const auto set = start()) request.start_ = std::max<gint64>(*set - delay, 0);
  if (const auto set = stop(); set && *set >= 0) request.stop_ = std::max<gint64>(*set - delay, 0);
  return request;
}

OwnedEvent SeekRequest::event() const {
  GstEvent* const seek =
      gst_event_new_seek(rate_, format_, flags_, start_type_, start_, stop_type_, stop_);
  gst_event_set_seqnum(seek, seqnum_);
  return OwnedEvent(seek);
}

bool count_from_start(OwnedEvent& seek, GstPad* pad) {
  const SeekRequest request(seek.get());
  if (!request.counts_from_end()) return true;
  const auto query = GST_PAD_IS_SRC(pad) ? gst_pad_query_duration : gst_pad_peer_query_duration;
  gint64 duration = 0;
  if (query(pad, GST_FORMAT_TIME, &duration) == FALSE) {
    GST_WARNING_OBJECT(pad, "duration unknown: refused %" GST_PTR_FORMAT, seek.get());
    return false;
  }
  seek = request.from_start(duration).event();
  return true;
}

/// Segment of a sink pad; a segment from 0 if it received none in time format.
static GstSegment segment_of(GstPad* sink) {
  const OwnedEvent event(gst_pad_get_sticky_event(sink, GST_EVENT_SEGMENT, 0));
  if (event && segment_of(event.get()).format == GST_FORMAT_TIME) return segment_of(event.get());
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  return segment;
}

bool would_seek(GstPad* sink, const SeekRequest& request) {
  GstSegment segment = segment_of(sink);
  return request.plays_on_from_time() && peer_can_seek(sink, GST_FORMAT_TIME) &&
         request.apply(segment);
}
