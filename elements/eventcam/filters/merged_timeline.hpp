// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>

#include <atomic>
#include <optional>
#include <span>

#include "gst/aggregator/sink_pads.hpp"
#include "gst/base/element.hpp"
#include "gst/base/seek_request.hpp"
#include "src/core/sensor_size.hpp"
#include "src/filter/event_merge.hpp"

/// Column and row of the merged sensor where a pad's sensor starts.
struct SensorPosition {
  guint x = 0;
  guint y = 0;

  friend bool operator==(const SensorPosition&, const SensorPosition&) = default;
};

/// Sink pad of eventmerge, with its stream.
#define GST_TYPE_EVENT_MERGE_PAD (gst_event_merge_pad_get_type())
G_DECLARE_FINAL_TYPE(GstEventMergePad, gst_event_merge_pad, GST, EVENT_MERGE_PAD, GstAggregatorPad)

struct GstEventMergePadPrivate {
  GstEventMergePadPrivate() { stop(); }

  void unload();
  void flush();
  void stop();
  /// Keeps the segment, which a flush resets, for a second seek before the next segment.
  void handle_segment(GstEvent* event);

  Guarded<SensorPosition> position;  ///< properties xpos and ypos
  std::atomic<bool> was_linked = false;
  Guarded<GstSegment> segment;  ///< the last one received; a flush does not reset it

  guint32 segment_seqnum = GST_SEQNUM_INVALID;
  bool segment_is_new = false;      ///< not the first segment, and none of its events are merged
  bool goes_back = false;           ///< the loaded interval goes back in a new segment, and waits
  bool has_output_segment = false;  ///< the output has the segment of this pad
  eventcamera::SensorSize sensor;   ///< 0x0 before caps
  SensorPosition placed;            ///< position in the negotiated output
  eventcamera::MergeInput input;
  OwnedBuffer loaded;          ///< queued buffer that `input` was loaded from
  bool discontinuous = false;  ///< that buffer, or one dropped before it, is flagged DISCONT
};

struct _GstEventMergePad {
  GstAggregatorPad parent;
  GstEventMergePadPrivate* priv;
};

/// Stream time of the output of eventmerge, where 0 is the timestamp at which the first input
/// starts: segments, seeks, and queries about them.
class MergedTimeline {
 public:
  explicit MergedTimeline(GstElement* element) : element_(element) {}

  /// Translates the seek that GstAggregator forwards next to the stream time of each input. Called
  /// from any thread.
  void seek(const SeekRequest& request);
  void reset() { sought_.lock()->reset(); }

  /// Segment of a pad, up to the latest end of all segments.
  static GstSegment longest_segment(const OwnedAggregatorPad& of,
                                    std::span<const OwnedAggregatorPad> pads);
  /// Segment of the output: the longest segment of the stream that starts first. Start and stop of
  /// the last seek replace its start and stop, which not all streams may reach.
  GstSegment segment(const OwnedAggregatorPad& first,
                     std::span<const OwnedAggregatorPad> pads) const;

  /// Answers a duration query in time: up to the end of the last stream.
  gboolean answer_duration(GstQuery* query) const;
  /// Extends the answer to a seeking query up to the end of the last stream.
  void extend_seeking(GstQuery* query) const;

 private:
  GstClockTimeDiff start() const;
  GstClockTime timestamp_at(gint64 stream_time) const;
  std::optional<gint64> duration() const;

  GstElement* element_;
  Guarded<std::optional<SeekRequest>> sought_;  ///< the latest seek
};
