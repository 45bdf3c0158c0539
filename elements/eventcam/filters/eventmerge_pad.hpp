// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstaggregator.h>

#include "gst/base/guarded.hpp"
#include "gst/base/owned.hpp"
#include "src/core/sensor_size.hpp"
#include "src/filter/event_merge.hpp"

/// Pixel of the merged sensor where the top left one of a pad's sensor is.
struct SensorPosition {
  guint x = 0;
  guint y = 0;

  friend bool operator==(const SensorPosition&, const SensorPosition&) = default;
};

/// Sink pad of eventmerge, with its stream.
#define GST_TYPE_EVENT_MERGE_PAD (gst_event_merge_pad_get_type())
G_DECLARE_FINAL_TYPE(GstEventMergePad, gst_event_merge_pad, GST, EVENT_MERGE_PAD, GstAggregatorPad)

struct GstEventMergePadPrivate {
  GstEventMergePadPrivate() { gst_segment_init(&*segment.lock(), GST_FORMAT_TIME); }

  Guarded<SensorPosition> position;  ///< properties xpos and ypos
  Guarded<GstSegment> segment;       ///< the last one received, also while the pad is flushed

  // Accessed by the source pad's thread only, or while there is none.
  guint32 segment_seqnum = GST_SEQNUM_INVALID;
  bool segment_is_new = false;      ///< it is not the first, and nothing of it is merged yet
  bool goes_back = false;           ///< its loaded interval does, in a new segment, and waits
  bool has_output_segment = false;  ///< its segment is that of the output
  eventcamera::SensorSize sensor;   ///< 0x0 before caps
  SensorPosition placed;            ///< position in the negotiated output
  eventcamera::MergeInput input;
  OwnedBuffer loaded;          ///< queued buffer whose events `input` has
  bool discontinuous = false;  ///< its start, or that of a buffer dropped before it
};

struct _GstEventMergePad {
  GstAggregatorPad parent;
  GstEventMergePadPrivate* priv;
};
