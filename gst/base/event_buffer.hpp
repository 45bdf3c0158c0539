// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <span>

#include "gst/eventcamera/eventcamera.h"
#include "src/core/absolute_event.hpp"
#include "src/core/event.hpp"

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

  /// False where the buffer is no whole number of events. Then nothing else may be asked.
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

/// What lies less than this apart is at the same time: events know microseconds.
inline constexpr GstClockTime event_resolution = GST_USECOND;

/// The interval of a buffer of events. Where it does not say how long that is, up to its last
/// event; nothing where it has no PTS.
std::optional<EventInterval> interval_of(GstBuffer* buffer);
