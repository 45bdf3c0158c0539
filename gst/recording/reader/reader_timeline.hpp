// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "gst/base/guarded.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/seek_request.hpp"
#include "src/formats/recording_reader.hpp"

/// Size of the upstream file in bytes; 0 if unknown.
inline guint64 upstream_bytes(GstPad* sink) {
  gint64 size = 0;
  const bool known = gst_pad_peer_query_duration(sink, GST_FORMAT_BYTES, &size) != FALSE;
  return known && size > 0 ? static_cast<guint64>(size) : 0;
}

/// Bounds of a segment in whole microseconds, rounded outwards.
inline eventcamera::Microseconds position_of(const GstSegment& segment) {
  return microseconds(segment.position);
}
inline std::optional<eventcamera::Microseconds> stop_of(const GstSegment& segment) {
  if (!GST_CLOCK_TIME_IS_VALID(segment.stop)) return std::nullopt;
  return microseconds(segment.stop + GST_USECOND - 1);
}

/// Playback state of a reader: segment, position, duration, and a pending seek upstream. Answers
/// queries. May be used from any thread.
class ReaderTimeline {
 public:
  using Recording = std::shared_ptr<const eventcamera::RecordingReader>;

  /// A seek in push mode that waits for its BYTES segment.
  struct Restart {
    GstSegment segment = {};
    std::optional<eventcamera::SeekPoint> seek_point;  ///< unset: the start of the file
    guint32 seqnum = GST_SEQNUM_INVALID;
    guint32 superseded = GST_SEQNUM_INVALID;  ///< the seek that was pending before this one

    guint64 byte() const { return seek_point.value_or(eventcamera::SeekPoint{}).position; }
  };

  explicit ReaderTimeline(GstPad* sink) : sink_(sink) {}

  /// Forgets the stream, but not the mode.
  void reset() {
    const auto state = state_.lock();
    const bool is_pulling = state->is_pulling;
    *state = {};
    state->is_pulling = is_pulling;
  }

  /// Forgets the times of the file.
  void forget_file() {
    const auto state = state_.lock();
    state->duration = GST_CLOCK_TIME_NONE;
    gst_segment_init(&state->segment, GST_FORMAT_TIME);
  }

  void set_pulling(bool is_pulling) { state_.lock()->is_pulling = is_pulling; }
  bool is_pulling() { return state_.lock()->is_pulling; }

  /// Push mode: begins at a byte of a file, or, if `is_timed`, with words that have upstream's
  /// times.
  void begin_bytes(bool is_timed, guint64 position) {
    const auto state = state_.lock();
    state->is_timed = is_timed;
    state->pushed_bytes = position;
  }

  void add_bytes(guint64 count) { state_.lock()->pushed_bytes += count; }
  bool is_timed() { return state_.lock()->is_timed; }

  /// Whether positions in the recording differ from those upstream: seeks then read from the start.
  void set_compressed(bool is_compressed) { state_.lock()->is_compressed = is_compressed; }

  /// The recording whose seek points are used; null while there is none.
  void set_recording(Recording recording) {
    const auto state = state_.lock();
    state->recording.swap(recording);  // the old one is freed after the lock
  }

  /// The segment, relative to the origin of the recording; its position is where output is.
  GstSegment segment() {
    const auto state = state_.lock();
    GstSegment segment = state->segment;
    segment.duration = state->duration;
    return segment;
  }

  void set_segment(const GstSegment& segment) { state_.lock()->segment = segment; }

  void advance_to(GstClockTime position) {
    const auto state = state_.lock();
    if (!state->is_timed) state->segment.position = std::max(state->segment.position, position);
  }

  /// Duration of the file. In push mode, extrapolated from the bytes received so far if it is not
  /// known, but not once all are received: formats that are decoded as a whole have output little
  /// by then.
  GstClockTime duration() {
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

  /// Takes the duration of the recording, and posts a message if it has changed.
  void update_duration(const eventcamera::RecordingReader& recording) {
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

  gboolean answer(GstPad* src, GstQuery* query) {
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
        gst_query_set_segment(query, played.rate, GST_FORMAT_TIME,
                              static_cast<gint64>(played.start), static_cast<gint64>(stop));
        return TRUE;
      }
      default:
        return gst_pad_query_default(src, GST_OBJECT_PARENT(src), query);
    }
  }

  bool can_seek() { return is_pulling() || peer_can_seek(sink_, GST_FORMAT_BYTES); }

  /// The segment after a seek, from the position at which output is now; nothing if it is refused.
  /// An estimated duration may be too short, so it only serves to count from the end.
  std::optional<GstSegment> segment_after(const SeekRequest& request) {
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

  /// A bin sends a seek to each of its sinks, so the same seek may arrive on every source pad.
  guint32 last_seek() { return state_.lock()->last_seek; }
  void set_last_seek(guint32 seqnum) { state_.lock()->last_seek = seqnum; }

  /// Push mode: begins a seek to `segment`, which upstream completes with a BYTES segment.
  Restart begin_restart(const SeekRequest& request, const GstSegment& segment) {
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

  std::optional<Restart> restart() { return state_.lock()->restart; }
  void end_restart() { state_.lock()->restart.reset(); }

 private:
  struct State {
    State() { gst_segment_init(&segment, GST_FORMAT_TIME); }

    GstSegment segment = {};
    GstClockTime duration = GST_CLOCK_TIME_NONE;
    bool is_duration_exact = false;
    std::optional<Restart> restart;
    guint64 pushed_bytes = 0;  ///< offset in the file
    guint32 last_seek = GST_SEQNUM_INVALID;
    bool is_pulling = false;
    bool is_timed = false;
    bool is_compressed = false;
    Recording recording;
  };

  GstPad* sink_;
  Guarded<State> state_;
};
