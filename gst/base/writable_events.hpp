// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <span>
#include <string>
#include <vector>

#include "gst/eventcamera/eventcamera.h"
#include "src/core/absolute_event.hpp"
#include "src/formats/decoder.hpp"

/// Picks the events that a file can hold, sorted by time and within the sensor, counts the others,
/// and tells the user of an element of them: as soon as events are written again, and at the file's
/// end where there are more by then.
class WritableEvents {
 public:
  /// Warnings are of this code, which tells what the element does with a file.
  WritableEvents(GstElement* element, GstStreamError code) : element_(element), code_(code) {}

  /// Nothing is written yet: any time may come first.
  void begin_file(eventcamera::SensorSize sensor);

  /// Those of `events`, whose times count from `start`, that can be written. They are gone with the
  /// next call.
  std::span<const eventcamera::AbsoluteEvent> pick(std::span<const GstEventCameraEvent> events,
                                                   eventcamera::Microseconds start);

  void end_file();

 private:
  /// The events that are left out for one reason.
  struct LeftOut {
    guint64 count = 0;
    guint64 told = 0;
  };

  void tell(LeftOut& left_out, const std::string& why);
  void tell_of_earlier();
  void tell_of_outside();

  GstElement* element_;
  GstStreamError code_;
  eventcamera::SensorSize sensor_;
  eventcamera::Microseconds latest_ = 0;  ///< of what is written
  std::vector<eventcamera::AbsoluteEvent> picked_;
  LeftOut earlier_;
  LeftOut outside_;
};
