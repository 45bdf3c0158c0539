// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>

#include <atomic>

#include "gst/base/guarded.hpp"
#include "gst/base/owned.hpp"
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

  /// Drops the loaded interval.
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
