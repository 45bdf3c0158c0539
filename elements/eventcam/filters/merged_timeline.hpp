// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <optional>

#include "gst/base/seek_request.hpp"

/// Stream time of merged streams: 0 is the timestamp at which the first of them starts.
class MergedTimeline {
 public:
  /// Of the inputs of an eventmerge.
  explicit MergedTimeline(GstElement* element);

  /// Up to the end of the last stream; none if no end is known.
  std::optional<gint64> duration() const;
  /// Timestamp of a stream time.
  GstClockTime timestamp_at(gint64 stream_time) const;

  /// Lets each stream seek to the timestamps of `request` when it receives the same seek.
  void translate(const SeekRequest& request) const;

 private:
  GstElement* element_;
  GstClockTimeDiff start_ = G_MAXINT64;
};
