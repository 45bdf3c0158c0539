// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstflowcombiner.h>

#include <map>
#include <memory>
#include <span>
#include <vector>

#include "gst/base/event_buffer.hpp"
#include "gst/recording/eventreader.hpp"
#include "gst/recording/reader/reader_timeline.hpp"
#include "src/formats/recording_reader.hpp"

struct ReaderPad;

/// Caps of events read from a file, which have no framerate.
#define FILE_EVENTS_CAPS EVENT_CAPS ", framerate = (fraction) 0/1"

/// Sets the seqnum of `event`, if valid, and returns `event`.
GstEvent* with_seqnum(GstEvent* event, guint32 seqnum);

/// Source pads of a reader: adds them when the streams of a recording are known, and pushes its
/// output, after the events that must precede it.
class ReaderOutput {
 public:
  /// All arguments must outlive this object.
  ReaderOutput(GstElement* element, GstPad* sink, const EventReaderFormat& format,
               Guarded<FormatSettings>& settings, ReaderTimeline& timeline,
               GstPadEventFunction src_event, GstPadQueryFunction src_query);
  ~ReaderOutput();
  ReaderOutput(const ReaderOutput&) = delete;
  ReaderOutput& operator=(const ReaderOutput&) = delete;

  /// Forgets the file; pads of demuxers are removed.
  void reset();

  /// Sets the recording that output comes from; null: no output until the next call.
  void set_recording(std::shared_ptr<eventcamera::RecordingReader> recording);

  /// Upstream begins a new stream. Takes ownership of the event.
  void start_stream(GstEvent* stream_start);

  /// Starts the next output with a new segment.
  void interrupt();

  /// Flags the next output as discontinuous, in the same segment.
  void interrupt_data();

  /// Drops waiting events and flow returns.
  void flush();

  /// Leaves the next segment to upstream.
  void expect_segment();

  /// Sets the seqnum of further segments and messages.
  void set_seqnum(guint32 seqnum) { seqnum_ = seqnum; }

  /// True once all pads of the first streams were added.
  bool has_pads() const { return has_no_more_pads_; }

  /// Sends the events that must precede data, if some were not sent yet.
  GstFlowReturn begin();

  GstFlowReturn push(const eventcamera::RecordingReader::Start& start);
  GstFlowReturn push(const eventcamera::RecordingReader::Chunk& chunk);
  GstFlowReturn push(const eventcamera::RecordingReader::TimedFrame& item);
  GstFlowReturn push(const eventcamera::TriggerItem& item);
  GstFlowReturn push(const eventcamera::ImuItem& item);

  /// Forwards an event in order. Takes ownership of `event`.
  void forward(GstEvent* event);

  /// Posts SEGMENT_START if a segment seek was requested: a bin posts SEGMENT_DONE once all
  /// elements that posted this have ended.
  void post_segment_start();

  /// Ends the streams with EOS, or the segment with SEGMENT_DONE if a segment seek was requested.
  void end(bool failed);

 private:
  ReaderPad& pad_of(std::size_t stream);
  void start_streams();
  void post_collection();
  bool find_size(std::size_t stream);
  bool send_caps(std::size_t stream);
  void send_segment(ReaderPad& pad);
  GstFlowReturn handle_refused_size(std::size_t stream);
  template <class Sample>
  GstFlowReturn push_to_first(std::span<const Sample> samples);
  GstFlowReturn combined(ReaderPad& pad, GstFlowReturn result);
  void post_with_seqnum(GstMessage* message);
  void push_to_pads(GstEvent* event);

  GstElement* element_;
  GstPad* sink_;
  const EventReaderFormat& format_;
  Guarded<FormatSettings>& settings_;
  ReaderTimeline& timeline_;
  GstPadEventFunction src_event_;
  GstPadQueryFunction src_query_;
  std::shared_ptr<eventcamera::RecordingReader> recording_;

  std::vector<std::unique_ptr<ReaderPad>> pads_;
  std::map<std::size_t, ReaderPad*> pad_of_stream_;
  struct UnrefCombiner {
    void operator()(GstFlowCombiner* combiner) const { gst_flow_combiner_unref(combiner); }
  };
  std::unique_ptr<GstFlowCombiner, UnrefCombiner> combiner_{gst_flow_combiner_new()};
  bool has_no_more_pads_ = false;
  bool is_due_ = true;       ///< caps, segments or waiting events precede the next data
  OwnedEvent stream_start_;  ///< upstream's
  guint group_ = GST_GROUP_ID_INVALID;
  guint32 seqnum_ = GST_SEQNUM_INVALID;
  std::vector<OwnedEvent> waiting_;  ///< serialized events that follow caps and segments
  WarnOnce warn_of_assumption_;
};
