// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <memory>
#include <optional>

#include "gst/base/guarded.hpp"
#include "gst/base/seek_request.hpp"
#include "src/formats/recording_reader.hpp"

inline GstClockTime nanoseconds(eventcamera::Microseconds t) {
  return static_cast<GstClockTime>(std::max<eventcamera::Microseconds>(t, 0)) * GST_USECOND;
}

/// Size of the upstream file in bytes; 0 if unknown.
inline guint64 upstream_bytes(GstPad* sink) {
  gint64 size = 0;
  const bool known = gst_pad_peer_query_duration(sink, GST_FORMAT_BYTES, &size) != FALSE;
  return known && size > 0 ? static_cast<guint64>(size) : 0;
}

/// Bounds of a segment in whole microseconds, rounded outwards.
inline eventcamera::Microseconds position_of(const GstSegment& segment) {
  return static_cast<eventcamera::Microseconds>(segment.position / GST_USECOND);
}
inline std::optional<eventcamera::Microseconds> stop_of(const GstSegment& segment) {
  if (!GST_CLOCK_TIME_IS_VALID(segment.stop)) return std::nullopt;
  return static_cast<eventcamera::Microseconds>((segment.stop + GST_USECOND - 1) / GST_USECOND);
}

/// Where a reader is: the segment that it plays, its position and duration, and a seek that
/// upstream was asked for. Answers queries. May be used from any thread.
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
  void reset();

  /// Forgets the times of the file.
  void forget_file();

  void set_pulling(bool is_pulling) { state_.lock()->is_pulling = is_pulling; }
  bool is_pulling() { return state_.lock()->is_pulling; }

  /// Push mode: begins at a byte of a file, or, if `is_timed`, with words that have upstream's
  /// times.
  void begin_bytes(bool is_timed, guint64 position);
  void add_bytes(guint64 count) { state_.lock()->pushed_bytes += count; }
  bool is_timed() { return state_.lock()->is_timed; }

  /// Whether positions in the recording differ from those upstream: seeks then read from the start.
  void set_compressed(bool is_compressed) { state_.lock()->is_compressed = is_compressed; }

  /// The recording whose seek points are used; null while there is none.
  void set_recording(Recording recording);

  /// The segment, relative to the origin of the recording; its position is where output is.
  GstSegment segment();
  void set_segment(const GstSegment& segment) { state_.lock()->segment = segment; }
  void advance_to(GstClockTime position);

  /// Duration of the file. In push mode, extrapolated from the bytes received so far, if it is not
  /// known.
  GstClockTime duration();

  /// Takes the duration of the recording, and posts a message if it has changed.
  void update_duration(const eventcamera::RecordingReader& recording);

  gboolean answer(GstPad* src, GstQuery* query);

  bool can_seek();

  /// The segment after a seek, from the position at which output is now; nothing if it is refused.
  std::optional<GstSegment> segment_after(const SeekRequest& request);

  /// A bin sends a seek to each of its sinks, so the same seek may arrive on every source pad.
  guint32 last_seek() { return state_.lock()->last_seek; }
  void set_last_seek(guint32 seqnum) { state_.lock()->last_seek = seqnum; }

  /// Push mode: a seek to `segment` waits for upstream from now on.
  Restart begin_restart(const SeekRequest& request, const GstSegment& segment);
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
