// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <algorithm>
#include <span>
#include <string>
#include <vector>

#include "gst/base/errors.hpp"
#include "gst/base/event_buffer.hpp"
#include "src/formats/decoder.hpp"

/// Whether downstream of a source pad can seek in the bytes that it is given.
bool can_seek_bytes(GstPad* src);

/// What the elements that write event files have in common. Picks the events that a file can hold,
/// sorted by time and within the sensor, and counts the others. The user is warned of these as soon
/// as events are written again, and at the file's end where there are more by then.
class WritableEvents {
 public:
  /// Warnings are of this code, which tells what the element does with a file.
  WritableEvents(GstElement* element, GstStreamError code) : element_(element), code_(code) {}

  /// Nothing is written yet: any time may come first.
  void begin_file(eventcamera::SensorSize sensor);

  /// Whether events of this sensor can go on in the file; an error where not.
  bool accepts(eventcamera::SensorSize sensor) const;

  /// Hands the writable events of a buffer to `write`, in blocks that stay in the cache. False with
  /// an error where it is no buffer of events. Throws what `write` does.
  template <class Write>
  bool take(GstBuffer* buffer, const Write& write) {
    constexpr std::size_t block = 1 << 14;
    const MappedEvents mapped(buffer);
    if (!mapped || GST_BUFFER_PTS(buffer) > G_MAXINT64) {
      report_buffer(buffer);
      return false;
    }
    for (auto left = mapped.events(); !left.empty();) {
      const auto few = left.first(std::min(left.size(), block));
      left = left.subspan(few.size());
      write(pick(few, mapped.start()));
    }
    return true;
  }

  /// The writable ones of `events`, whose times count from `start`. Valid until the next call.
  std::span<const eventcamera::AbsoluteEvent> pick(std::span<const eventcamera::Event> events,
                                                   eventcamera::Microseconds start);

  void end_file();

  /// What to report where writing throws: `otherwise`, unless memory is short or the format cannot
  /// hold the stream.
  static Report failure(const std::exception& error, const Report& otherwise);

 private:
  /// The events that are left out for one reason.
  struct LeftOut {
    guint64 count = 0;
    guint64 reported = 0;
  };

  void report_buffer(GstBuffer* buffer) const;
  void warn_of_earlier();
  void warn_of_outside();
  void warn(LeftOut& left_out, const std::string& what, const std::string& cause);

  GstElement* element_;
  GstStreamError code_;
  eventcamera::SensorSize sensor_;
  eventcamera::Microseconds latest_ = 0;  ///< of what is written
  std::vector<eventcamera::AbsoluteEvent> picked_;
  LeftOut earlier_;
  LeftOut outside_;
};
