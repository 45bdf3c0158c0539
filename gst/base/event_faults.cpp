// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/event_faults.hpp"

#include <string>

void EventFaults::warn(gpointer element, EventFault fault, GstBuffer* buffer) {
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

void EventFaults::warn(gpointer element, const eventcamera::InvalidEvents& invalid,
                       GstBuffer* buffer) {
  if (invalid.outside > 0) warn(element, EventFault::beyond_sensor, buffer);
  if (invalid.unsorted > 0) warn(element, EventFault::unsorted, buffer);
}
