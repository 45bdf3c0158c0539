// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "gst/base/errors.hpp"
#include "gst/base/owned.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "src/core/event.hpp"
#include "src/core/event_validator.hpp"
#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"

/// Time in GStreamer's unit; negative times become 0.
constexpr GstClockTime nanoseconds(eventcamera::Microseconds t) {
  return t < 0 ? 0 : static_cast<GstClockTime>(t) * GST_USECOND;
}
/// Time in the core's unit, rounded down.
constexpr eventcamera::Microseconds microseconds(GstClockTime t) {
  return static_cast<eventcamera::Microseconds>(t / GST_USECOND);
}

/// Interval of a buffer: the times of its events are at least `start` and at most `end`.
struct EventInterval {
  GstClockTime start;
  GstClockTime end;
};

/// Length of an interval in microseconds: the maximum time of its events.
inline eventcamera::Microseconds length_of(const EventInterval& interval) {
  return microseconds(interval.end - interval.start);
}

/// Sets the times of a new buffer, and flags it DISCONT if `is_discontinuous`, which it clears.
inline void stamp(GstBuffer* buffer, const EventInterval& interval, bool& is_discontinuous) {
  GST_BUFFER_PTS(buffer) = interval.start;
  GST_BUFFER_DURATION(buffer) = interval.end - interval.start;
  if (std::exchange(is_discontinuous, false)) GST_BUFFER_FLAG_SET(buffer, GST_BUFFER_FLAG_DISCONT);
}

/// Interval of a buffer of events. Without a duration it ends at the last event. None without a
/// PTS, or with one of more than 292 years.
std::optional<EventInterval> interval_of(GstBuffer* buffer);

/// Maps the events of a buffer for reading.
class MappedEvents {
 public:
  explicit MappedEvents(GstBuffer* buffer)
      : interval_(interval_of(buffer)), mapped_(interval_ && gst_event_camera_map(&map_, buffer)) {}
  ~MappedEvents() {
    if (mapped_) gst_event_camera_unmap(&map_);
  }
  MappedEvents(const MappedEvents&) = delete;
  MappedEvents& operator=(const MappedEvents&) = delete;

  /// False if the events cannot be read, because of event_fault(). Nothing else may be called then.
  explicit operator bool() const { return mapped_; }

  const EventInterval& interval() const { return *interval_; }

  /// The events as the core's Event, which has the layout of GstEventCameraEvent.
  std::span<const eventcamera::Event> events() const {
    return {reinterpret_cast<const eventcamera::Event*>(map_.events), map_.n_events};
  }

  /// Time that event times are relative to, in microseconds.
  eventcamera::Microseconds start() const {
    return static_cast<eventcamera::Microseconds>(map_.start);
  }

 private:
  std::optional<EventInterval> interval_;
  GstEventCameraMap map_{};
  bool mapped_;
};

/// Resolution of event times; times closer than this count as equal.
inline constexpr GstClockTime event_resolution = GST_USECOND;

/// Longest pause that is filled with empty pictures or tensors; longer ones are skipped.
inline constexpr GstClockTime max_pause = 60 * GST_SECOND;

/// Labels of the events of a buffer; they may be changed if it is writable. Empty if it has none.
std::span<eventcamera::Label> labels_of(GstBuffer* buffer);

/// Adds labels to a writable buffer without any, one for each of its events. Throws std::bad_alloc.
std::span<eventcamera::Label> add_labels(GstBuffer* buffer, gsize events);

/// Cuts a writable buffer, which must not be mapped, to its first events and their labels.
void truncate_events(GstBuffer* buffer, gsize count);

/// Caps fields of a frame or sensor of any size.
#define SIZE_CAPS \
  "width = (int) [ 1, " G_STRINGIFY(GST_EVENT_CAMERA_MAX_SIDE) " ], " \
  "height = (int) [ 1, " G_STRINGIFY(GST_EVENT_CAMERA_MAX_SIDE) " ]"
static_assert(GST_EVENT_CAMERA_MAX_SIDE == eventcamera::max_side);

/// Caps of an event stream in memory format.
#define EVENT_CAPS GST_EVENT_CAMERA_MEDIA_TYPE ", format = (string) XYTP, " SIZE_CAPS

/// Sensor of an event stream in memory format; none for other caps.
inline std::optional<eventcamera::SensorSize> sensor_of(const GstCaps* caps) {
  GstEventCameraInfo info;
  if (!gst_event_camera_info_from_caps(&info, caps)) return std::nullopt;
  return eventcamera::SensorSize{info.width, info.height};
}

/// Caps of events in memory format, from a sensor of this size, with a variable framerate.
inline OwnedCaps event_caps(eventcamera::SensorSize sensor) {
  GstEventCameraInfo info = {};
  info.width = sensor.width;
  info.height = sensor.height;
  info.fps_d = 1;
  return OwnedCaps(gst_event_camera_info_to_caps(&info));
}

/// Reason for skipping events of a buffer.
enum class EventFault { no_pts, pts_too_large, partial_event, beyond_sensor, unsorted };

/// Reason why the events of a buffer cannot be read, or are past the supported times.
inline EventFault event_fault(GstBuffer* buffer) {
  if (!GST_BUFFER_PTS_IS_VALID(buffer)) return EventFault::no_pts;
  return gst_buffer_get_size(buffer) % sizeof(eventcamera::Event) != 0 ? EventFault::partial_event
                                                                       : EventFault::pts_too_large;
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

  void reset() {
    for (auto& warning : warnings_) warning.reset();
  }

 private:
  const char* verb_;
  std::array<WarnOnce, 5> warnings_;  ///< one per EventFault
};

inline void EventFaults::warn(gpointer element, EventFault fault, GstBuffer* buffer) {
  static constexpr std::array reasons = {
      "a buffer has no PTS", "a buffer's PTS is more than 292 years",
      "a buffer's size is not a multiple of 8 bytes", "some are outside the sensor",
      "some are earlier than the previous one, or later than the end of their buffer"};
  const auto index = static_cast<std::size_t>(fault);
  gchar* cause = gst_info_strdup_printf("%" GST_PTR_FORMAT, buffer);
  warnings_[index](element,
                   {GST_STREAM_ERROR_FORMAT, std::string("Cannot ") + verb_ + " all events: " +
                                                 reasons[index] + "; skipping them."},
                   cause);
  g_free(cause);
}

inline void EventFaults::warn(gpointer element, const eventcamera::InvalidEvents& invalid,
                              GstBuffer* buffer) {
  if (invalid.outside > 0) warn(element, EventFault::beyond_sensor, buffer);
  if (invalid.unsorted > 0) warn(element, EventFault::unsorted, buffer);
}
