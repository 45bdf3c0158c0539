// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>
#include <gst/video/video.h>

#include <array>
#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gst/base/event_caps.hpp"
#include "gst/base/owned.hpp"
#include "src/formats/recording_reader.hpp"

/// Memory of event buffers that were freed, in any thread, for further buffers. It is kept while
/// buffers need as much, and up to a limit.
class SpareMemory {
 public:
  std::vector<eventcamera::Event> pop();
  void push(std::vector<eventcamera::Event> memory) noexcept;

 private:
  static constexpr std::size_t max_events = std::size_t{1} << 23;  // 64 MiB

  std::mutex mutex_;
  std::array<std::vector<eventcamera::Event>, 16> spare_;
  std::size_t count_ = 0;     ///< number of them
  std::size_t capacity_ = 0;  ///< of all of them, in events
  std::size_t needed_ = 0;    ///< events of a recent buffer: a maximum that decays
};

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
  /// Pushes the first `count` events of `memory`, at least one, without copying them, and their
  /// labels, if there are any. Throws std::bad_alloc.
  GstFlowReturn push(std::vector<eventcamera::Event> memory, std::size_t count,
                     std::span<const eventcamera::Label> labels, GstClockTime pts,
                     GstClockTime duration);

  /// Memory of a buffer that was freed, or none.
  std::vector<eventcamera::Event> spare_memory() { return spare_->pop(); }

  GstFlowReturn push_gap(GstClockTime pts, GstClockTime duration);

  /// Flow return after send_caps() failed.
  GstFlowReturn refusal() const;

 private:
  bool push_caps(GstCaps* caps);

  GstPad* pad_;
  std::string name_;
  GstDebugCategory* category_;
  std::shared_ptr<SpareMemory> spare_ = std::make_shared<SpareMemory>();
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
