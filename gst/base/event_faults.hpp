// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <array>
#include <string>

#include "gst/base/errors.hpp"
#include "src/core/event_validator.hpp"

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

  /// For a new stream: warnings are posted again.
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
