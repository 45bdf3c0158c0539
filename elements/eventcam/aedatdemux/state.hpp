// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstflowcombiner.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include <mutex>
#include <optional>
#include <vector>

#include "gst/base/owned.hpp"
#include "gst/base/reading_faults.hpp"
#include "gst/base/reading_properties.hpp"
#include "src/formats/aedat/aedat4_table.hpp"
#include "src/formats/aedat/aedat_reader.hpp"
#include "src/formats/chunker.hpp"
#include "src/formats/sensor_sizes.hpp"

GST_DEBUG_CATEGORY_EXTERN(aedat_demux_debug);
#define GST_CAT_DEFAULT aedat_demux_debug

namespace aedatdemux {

using eventcamera::AbsoluteEvent;
using eventcamera::Aedat4Kind;
using eventcamera::Aedat4TableEntry;
using eventcamera::AedatReader;
using eventcamera::Chunker;
using eventcamera::Microseconds;
using eventcamera::SensorSize;
using eventcamera::UsedPixels;

/// Whether a stream has a pad.
inline bool is_shown(Aedat4Kind kind) {
  return kind == Aedat4Kind::events || kind == Aedat4Kind::frames;
}

/// One of the file's streams, of any kind.
struct Stream {
  Aedat4Kind kind;
  guint number;  ///< among those of its kind
  SensorSize size;
  bool size_assumed = false;
  GstPad* pad = nullptr;  ///< the element's; none while it is not shown
  Chunker chunker;
  std::optional<Microseconds> first;  ///< its earliest time, as far as it was held back
  UsedPixels used{};                  ///< by the events that were held back
  std::optional<GstVideoInfo> video;  ///< that of the caps
  GstClockTime position = 0;          ///< it was handed out until here
  bool segment_due = true;
  bool discontinuous = true;
};

struct Frame {
  Microseconds t = 0;
  GstVideoInfo info = {};
  OwnedBuffer buffer;
};

/// What is held back until the zero of time is known.
struct Held {
  std::size_t stream;
  std::vector<AbsoluteEvent> events;
  Frame frame;  ///< without a buffer where it is events
};

struct Counts {
  guint64 events = 0;
  guint64 frames = 0;
  guint64 triggers = 0;
  guint64 imu_samples = 0;
  guint64 corrupt_places = 0;
  guint64 outside = 0;   ///< events beyond the sensor
  guint64 untimely = 0;  ///< events and frames whose time cannot be
  guint64 repeated = 0;  ///< events of another's pixel and time
};

/// What is made of the bytes so far.
struct State {
  AedatReader reader;
  std::vector<Stream> streams;  ///< the reader's, with the same indices
  guint64 pulled = 0;           ///< position of the next byte
  bool table_sought = false;
  bool table_missing = false;  ///< where the header says that there is one
  std::vector<Aedat4TableEntry> table;
  bool holding = true;
  std::vector<Held> held;
  std::size_t held_bytes = 0;
  Microseconds zero = 0;            ///< once nothing is held back
  bool duration_estimated = false;  ///< and not yet known
  GstClockTime newest = 0;          ///< the greatest position of a stream
  std::vector<AbsoluteEvent> within;
  Counts counts;  ///< but for what reader and chunkers count
};

}  // namespace aedatdemux

struct GstAedatDemuxPrivate {
  explicit GstAedatDemuxPrivate(GstElement* element) : faults(element, GST_STREAM_ERROR_DEMUX) {}

  GstPad* sink = nullptr;
  GstFlowCombiner* combiner = nullptr;

  std::mutex mutex;  // guards what follows; nothing is called under it
  GstClockTime buffer_time = default_buffer_time;
  GstSegment segment = {};  ///< position is that of the output
  bool pulls = false;
  bool shown = false;  ///< there are pads to seek by
  aedatdemux::Counts counts;

  // Under the sink pad's stream lock.
  ReadingFaults faults;
  aedatdemux::State state;
  GstFlowReturn flow = GST_FLOW_OK;  ///< pushed bytes are refused once it is something else
  guint group = GST_GROUP_ID_INVALID;
  guint32 seqnum = GST_SEQNUM_INVALID;
  bool flushed = false;  ///< the next byte segment tells where bytes go on
};

struct GstAedatDemux {
  GstElement parent;
  GstAedatDemuxPrivate* priv;
};

struct GstAedatDemuxClass {
  GstElementClass parent_class;
};

namespace aedatdemux {

inline GstAedatDemux* demux_of(gpointer object) {
  return static_cast<GstAedatDemux*>(object);
}

/// How much time a buffer of events covers.
Microseconds interval_length(GstAedatDemux* self);

/// Where a stream's output goes on.
Microseconds output_start(GstAedatDemux* self);

/// Forgets the stream, but for its pads.
void reset(GstAedatDemux* self);

/// Makes ready for output from the segment's start on.
void begin_anew(GstAedatDemux* self);

}  // namespace aedatdemux
