// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>
#include <gst/video/video.h>

#include <optional>
#include <span>
#include <string>

#include "src/formats/recording_reader.hpp"

/// A source pad of an element that reads files: a stream of the file, and what goes through the pad
/// before its data.
class ReaderPad {
 public:
  /// Makes the pad, and activates it. It is not yet the element's.
  ReaderPad(GstPadTemplate* templ, const std::string& name);
  ~ReaderPad();
  ReaderPad(const ReaderPad&) = delete;
  ReaderPad& operator=(const ReaderPad&) = delete;

  GstPad* get() const { return pad_; }
  const std::string& name() const { return name_; }
  bool is_added() const { return GST_OBJECT_PARENT(pad_) != nullptr; }

  /// Forgets what was sent, because another stream comes.
  void reset();

  /// What comes next does not follow on what was sent, and needs a segment.
  void interrupt();

  /// Data is missing before what comes next.
  void interrupt_data() { discontinuous_ = true; }

  /// Begins a stream of video, which events are to players, because they are drawn.
  void start_stream(GstElement* element, guint group);

  /// Begins a stream as upstream did.
  void start_stream(GstEvent* upstream);
  bool is_started() const { return started_; }

  /// Names the file's format, and the camera of the stream.
  void send_tags(const std::string& format, const std::string& camera);

  /// Sends caps that were not sent before. False where they are refused.
  bool send_caps(eventcamera::SensorSize size);
  bool send_caps(const GstVideoInfo& info);
  bool has_video() const { return video_.has_value(); }

  /// Sends a segment, where that is due.
  void send_segment(const GstSegment& segment, guint32 seqnum);
  void need_segment(bool due) { segment_due_ = due; }

  GstFlowReturn push(GstBuffer* buffer, GstClockTime pts);
  GstFlowReturn push_gap(GstClockTime pts, GstClockTime duration);

  /// Where sending caps failed.
  GstFlowReturn refusal() const;

 private:
  bool push_caps(GstCaps* caps);

  GstPad* pad_;
  std::string name_;
  bool started_ = false;
  bool segment_due_ = true;
  bool discontinuous_ = true;
  eventcamera::SensorSize size_;  ///< of the caps
  std::optional<GstVideoInfo> video_;
};

/// The caps of events that are read from a file: they come in intervals of no frame.
#define FILE_EVENTS_CAPS                                                             \
  "application/x-event-camera, format = (string) XYTP, width = (int) [ 1, 65535 ], " \
  "height = (int) [ 1, 32768 ], framerate = (fraction) 0/1"

/// Gives an event the number of the seek that it belongs to, if any; takes and returns it.
GstEvent* with_seqnum(GstEvent* event, guint32 seqnum);
