// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>
#include <gst/video/video.h>

#include <optional>
#include <span>
#include <string>

#include "gst/base/event_caps.hpp"
#include "gst/base/event_pool.hpp"
#include "gst/base/owned.hpp"
#include "src/formats/recording_reader.hpp"

/// Source pad for one stream of a file, with the state of its events: stream-start, caps, tags and
/// segment.
class ReaderPad {
 public:
  /// Creates the pad without adding it to an element. Logs in `category`.
  ReaderPad(GstPadTemplate* templ, const std::string& name, GstDebugCategory* category);
  ~ReaderPad();
  ReaderPad(const ReaderPad&) = delete;
  ReaderPad& operator=(const ReaderPad&) = delete;

  GstPad* get() const { return pad_; }
  const std::string& name() const { return name_; }
  bool is_added() const { return GST_OBJECT_PARENT(pad_) != nullptr; }

  /// Forgets what was sent, for a new stream.
  void reset();

  /// Marks the next data as discontinuous; a new segment is due.
  void interrupt();

  /// Marks the next data as discontinuous, in the same segment.
  void interrupt_data() { discontinuous_ = true; }

  /// Starts a new stream. Event streams have type video, because players draw them.
  void start_stream(GstElement* element, guint group);

  /// Starts a stream with upstream's stream-start event. Takes ownership of `upstream`.
  void start_stream(GstEvent* upstream);
  bool is_started() const { return started_; }

  /// Sends tags with the file format and the camera model.
  void send_tags(const std::string& format, const std::string& camera);

  /// Sends caps unless already sent. False if they are refused.
  bool send_caps(eventcamera::SensorSize size);
  bool send_caps(const GstVideoInfo& info);
  bool has_video() const { return video_.has_value(); }

  /// Sends a segment if one is due.
  void send_segment(const GstSegment& segment, guint32 seqnum);
  void need_segment(bool due) { segment_due_ = due; }

  GstFlowReturn push(GstBuffer* buffer, GstClockTime pts);
  /// Pushes events, at least one, and their labels, if there are any. Throws std::bad_alloc.
  GstFlowReturn push(std::span<const eventcamera::Event> events,
                     std::span<const eventcamera::Label> labels, GstClockTime pts,
                     GstClockTime duration);
  GstFlowReturn push_gap(GstClockTime pts, GstClockTime duration);

  /// Flow return after send_caps() failed.
  GstFlowReturn refusal() const;

 private:
  bool push_caps(GstCaps* caps);

  GstPad* pad_;
  std::string name_;
  GstDebugCategory* category_;
  EventBuffers buffers_;  ///< while the stream lasts
  bool started_ = false;
  bool segment_due_ = true;
  bool discontinuous_ = true;
  eventcamera::SensorSize size_;  ///< size in the caps sent last
  std::optional<GstVideoInfo> video_;
};

/// Caps of events read from a file, which have no framerate.
#define FILE_EVENTS_CAPS EVENT_CAPS ", framerate = (fraction) 0/1"

/// Sets the seqnum of `event`, if valid, and returns `event`.
GstEvent* with_seqnum(GstEvent* event, guint32 seqnum);
