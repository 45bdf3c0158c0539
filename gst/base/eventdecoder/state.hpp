// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "gst/base/eventdecoder.hpp"
#include "gst/base/owned.hpp"
#include "gst/base/reading_faults.hpp"
#include "gst/base/reading_properties.hpp"
#include "src/formats/chunker.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/sensor_sizes.hpp"

GST_DEBUG_CATEGORY_EXTERN(event_decoder_debug);
#define GST_CAT_DEFAULT event_decoder_debug

namespace eventdecoder {

using eventcamera::Chunker;
using eventcamera::Corruption;
using eventcamera::Decoded;
using eventcamera::Decoder;
using eventcamera::EventFile;
using eventcamera::Microseconds;
using eventcamera::SeekPoint;
using eventcamera::SensorSize;
using eventcamera::UsedPixels;

struct Counts {
  guint64 events = 0;
  guint64 triggers = 0;
  guint64 corrupt_places = 0;
  guint64 outside = 0;
  Chunker::Dropped dropped;
};

/// Where to go on after a seek.
struct Restart {
  GstSegment segment = {};              ///< to play, the first event being at 0
  std::optional<SeekPoint> seek_point;  ///< none: the file's beginning
  guint32 seqnum = GST_SEQNUM_INVALID;
};

/// What is made of the bytes so far.
struct State {
  std::unique_ptr<Decoder> decoder;    ///< none of an EventFile
  GstFlowReturn unread = GST_FLOW_OK;  ///< why bytes of the file could not be pulled
  std::unique_ptr<EventFile> file;     ///< once it is open
  std::vector<guint8> collected;       ///< to be opened, if it is pushed
  Chunker chunker;
  Decoded decoded;
  guint64 pulled = 0;                   ///< position of the next byte
  bool at_end = false;                  ///< there is none
  bool scanned = false;                 ///< the duration is known, or estimated
  bool consumed = false;                ///< the decoder was given something
  GstFlowReturn stopped = GST_FLOW_OK;  ///< why a buffer was left half read: what follows is lost
  UsedPixels used{};                    ///< while the decoder does not know the size
  std::optional<SensorSize> assumed;    ///< where the decoder does not tell
  guint64 outside = 0;                  ///< of it
  Corruption before;                    ///< the decoder's, when it was restarted
  std::optional<Microseconds> shift;    ///< from the decoder's time to upstream's, if it has one

  SensorSize told_size() const {
    if (file) return file->size();
    return decoder ? decoder->size() : SensorSize{};
  }
  const Corruption& corruption() const {
    static const Corruption none;
    if (file) return file->corruption();
    return decoder ? decoder->corruption() : none;
  }
};

}  // namespace eventdecoder

struct GstEventDecoderPrivate {
  explicit GstEventDecoderPrivate(GstElement* element) : faults(element, GST_STREAM_ERROR_DECODE) {}

  GstPad* sink = nullptr;
  GstPad* src = nullptr;

  std::mutex mutex;  // guards what follows; nothing is called under it
  GstClockTime buffer_time = default_buffer_time;
  GstSegment segment = {};  ///< as if the first event were at 0; position is that of the output
  std::optional<eventcamera::Microseconds> first;  ///< time of the first event
  GstClockTime duration = GST_CLOCK_TIME_NONE;     ///< the file's
  std::optional<eventdecoder::Restart> restart;    ///< asked for and not yet done, pushed only
  bool pulls = false;
  bool timed = false;        ///< upstream has times itself
  guint64 pushed_bytes = 0;  ///< since the file's beginning
  eventdecoder::Counts counts;

  // Guards the decoder against a seek that looks for a seek point. Taken before `mutex`.
  std::mutex decoding;

  // The streaming thread's, or nobody's while there is none.
  ReadingFaults faults;
  OwnedCaps caps;  // of the input
  std::optional<eventdecoder::State> state;
  GstEvent* stream_start = nullptr;  ///< upstream's, until it is sent
  bool stream_started = false;
  bool caps_sent = false;
  bool segment_due = true;
  guint32 seqnum = GST_SEQNUM_INVALID;
  bool discontinuous = false;
  std::vector<GstEvent*> held;  ///< until caps and segment are sent
};

namespace eventdecoder {

/// How much time a buffer covers.
Microseconds interval_length(GstEventDecoder* self);

/// Whether upstream has times itself.
bool is_timed(GstEventDecoder* self);

/// Whether it is an EventFile that is read.
bool reads_files(GstEventDecoder* self);

/// Makes a decoder that has read nothing. May throw.
void begin(GstEventDecoder* self);

/// Forgets the events that wait for caps and segment.
void drop_held(GstEventDecoder* self);

/// Forgets the stream.
void reset(GstEventDecoder* self);

/// Goes on at a seek point, or the beginning, for the events of a segment; what was counted by then
/// is forgotten. May throw.
void restart_at(GstEventDecoder* self, const Restart& restart);

/// Where to go on for a time of the segment; nothing where no seek point is.
std::optional<SeekPoint> seek_point_before(GstEventDecoder* self, GstClockTime time);

}  // namespace eventdecoder
