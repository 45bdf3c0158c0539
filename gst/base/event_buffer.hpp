// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <span>

#include "gst/eventcamera/eventcamera.h"
#include "src/core/event.hpp"
#include "src/core/label.hpp"

/// Interval of a buffer: the times of its events are at least `start` and at most `end`.
struct EventInterval {
  GstClockTime start;
  GstClockTime end;
};

/// Length of an interval in microseconds: the maximum time of its events.
inline eventcamera::Microseconds length_of(const EventInterval& interval) {
  return static_cast<eventcamera::Microseconds>((interval.end - interval.start) / GST_USECOND);
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
