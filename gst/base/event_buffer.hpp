// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <optional>
#include <span>

#include "gst/base/errors.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "src/core/event.hpp"

/// The caps of a stream of events in memory.
#define EVENT_CAPS            \
  GST_EVENT_CAMERA_MEDIA_TYPE \
  ", format = (string) XYTP, width = (int) [ 1, 16384 ], height = (int) [ 1, 16384 ]"

/// The events of a buffer, mapped while this lives.
class MappedEvents {
 public:
  explicit MappedEvents(GstBuffer* buffer)
      : mapped_(gst_event_camera_map(&map_, buffer) != FALSE) {}
  ~MappedEvents() {
    if (mapped_) gst_event_camera_unmap(&map_);
  }
  MappedEvents(const MappedEvents&) = delete;
  MappedEvents& operator=(const MappedEvents&) = delete;

  /// False where the buffer's size is not a multiple of an event's. Then nothing else may be
  /// called.
  explicit operator bool() const { return mapped_; }

  /// The core's events are laid out as the application's are.
  std::span<const eventcamera::Event> events() const {
    return {reinterpret_cast<const eventcamera::Event*>(map_.events), map_.n_events};
  }

  /// The time that those of the events count from, in microseconds.
  eventcamera::Microseconds start() const {
    return static_cast<eventcamera::Microseconds>(map_.start);
  }

 private:
  GstEventCameraMap map_{};
  bool mapped_;
};

/// An interval of time, (start, end].
struct EventInterval {
  GstClockTime start;
  GstClockTime end;
};

/// Times closer than this are the same: events have microseconds.
inline constexpr GstClockTime event_resolution = GST_USECOND;

/// The interval of a buffer of events: up to its last event where it has no duration, nothing where
/// it has no PTS.
std::optional<EventInterval> interval_of(GstBuffer* buffer);

/// Why events of a buffer are skipped.
enum class EventFault { no_pts, partial_event, beyond_sensor };

/// Warns the user of an element of events that it has to skip: of each fault once a stream.
class EventFaults {
 public:
  /// `verb` is what the element does with events: "draw".
  explicit EventFaults(const char* verb) : verb_(verb) {}

  void warn(gpointer element, EventFault fault, GstBuffer* buffer);

  /// Another stream begins.
  void reset() { warnings_ = {}; }

 private:
  const char* verb_;
  std::array<WarnOnce, 3> warnings_{};
};
