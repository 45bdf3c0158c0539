// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>

#include <optional>
#include <span>

#include "gst/aggregator/sink_pads.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/seek_request.hpp"

/// Stream time of the output of eventmerge, where 0 is the timestamp at which the first input
/// starts: segments, seeks, and queries about them.
class MergedTimeline {
 public:
  explicit MergedTimeline(GstElement* element) : element_(element) {}

  /// Translates the seek that GstAggregator forwards next to the stream time of each input. Called
  /// from any thread.
  void seek(const SeekRequest& request);
  /// Forgets the last seek.
  void reset() { sought_.lock()->reset(); }

  /// Segment of a pad, up to the latest end of all segments.
  static GstSegment longest_segment(const OwnedAggregatorPad& of,
                                    std::span<const OwnedAggregatorPad> pads);
  /// Segment of the output: the longest segment of the stream that starts first. Start and stop of
  /// the last seek replace its own, as not all streams may reach them.
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
