// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <optional>
#include <span>

#include "gst/base/errors.hpp"
#include "gst/base/owned.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "src/core/event.hpp"
#include "src/core/invalid_events.hpp"
#include "src/core/label.hpp"
#include "src/core/max_side.hpp"

/// Caps fields of a frame or sensor of any size.
#define SIZE_CAPS \
  "width = (int) [ 1, " G_STRINGIFY(GST_EVENT_CAMERA_MAX_SIDE) " ], " \
  "height = (int) [ 1, " G_STRINGIFY(GST_EVENT_CAMERA_MAX_SIDE) " ]"
static_assert(GST_EVENT_CAMERA_MAX_SIDE == eventcamera::max_side);

/// Caps of an event stream in memory format.
#define EVENT_CAPS GST_EVENT_CAMERA_MEDIA_TYPE ", format = (string) XYTP, " SIZE_CAPS

/// Property of decodebin to get events, which it would otherwise draw as video.
#define ASK_FOR_EVENTS "caps=\"application/x-event-camera,format=XYTP\""

/// Maps the events of a buffer for reading.
class MappedEvents {
 public:
  explicit MappedEvents(GstBuffer* buffer)
      : mapped_(gst_event_camera_map(&map_, buffer) != FALSE) {}
  ~MappedEvents() {
    if (mapped_) gst_event_camera_unmap(&map_);
  }
  MappedEvents(const MappedEvents&) = delete;
  MappedEvents& operator=(const MappedEvents&) = delete;

  /// False if mapping failed, for example because the buffer ends in a partial event. Nothing else
  /// may be called then.
  explicit operator bool() const { return mapped_; }

  /// The events as the core's Event, which has the layout of GstEventCameraEvent.
  std::span<const eventcamera::Event> events() const {
    return {reinterpret_cast<const eventcamera::Event*>(map_.events), map_.n_events};
  }

  /// Time that event times are relative to, in microseconds.
  eventcamera::Microseconds start() const {
    return static_cast<eventcamera::Microseconds>(map_.start);
  }

 private:
  GstEventCameraMap map_{};
  bool mapped_;
};

/// Caps of events in memory format, from a sensor of this size, with a variable framerate.
OwnedCaps event_caps(int width, int height);

/// Interval of a buffer: the times of its events are at least `start` and at most `end`.
struct EventInterval {
  GstClockTime start;
  GstClockTime end;
};

/// Length of an interval in microseconds, which no event of it is later than.
inline eventcamera::Microseconds length_of(const EventInterval& interval) {
  return static_cast<eventcamera::Microseconds>((interval.end - interval.start) / GST_USECOND);
}

/// Resolution of event times; times closer than this count as equal.
inline constexpr GstClockTime event_resolution = GST_USECOND;

/// Interval of a buffer of events. Without a duration it ends at the last event. None without a
/// PTS, or with one of more than 292 years.
std::optional<EventInterval> interval_of(GstBuffer* buffer);

/// Labels of the events of a buffer; they may be changed if it is writable. Empty if it has none.
std::span<eventcamera::Label> labels_of(GstBuffer* buffer);

/// Adds labels to a writable buffer without any, one for each of its events. Throws std::bad_alloc.
std::span<eventcamera::Label> add_labels(GstBuffer* buffer, gsize events);

/// Cuts a writable buffer, which must not be mapped, to its first events and their labels.
void truncate_events(GstBuffer* buffer, gsize count);

/// Reason for skipping events of a buffer.
enum class EventFault { no_pts, pts_too_large, partial_event, beyond_sensor, unsorted };

/// Why a buffer has no interval, or one that is too late for its use.
inline EventFault interval_fault(GstBuffer* buffer) {
  return GST_BUFFER_PTS_IS_VALID(buffer) ? EventFault::pts_too_large : EventFault::no_pts;
}

/// Posts warnings about events that an element skips, once per fault and stream.
class EventFaults {
 public:
  /// `verb` is what the element does with events, such as "draw".
  EventFaults(const char* verb, GstDebugCategory* category)
      : verb_(verb),
        warnings_{WarnOnce(category), WarnOnce(category), WarnOnce(category), WarnOnce(category),
                  WarnOnce(category)} {}

  void warn(gpointer element, EventFault fault, GstBuffer* buffer);
  void warn(gpointer element, const eventcamera::InvalidEvents& invalid, GstBuffer* buffer);

  /// For a new stream: warnings are posted again.
  void reset() {
    for (auto& warning : warnings_) warning.reset();
  }

 private:
  const char* verb_;
  std::array<WarnOnce, 5> warnings_;  ///< one per EventFault
};
