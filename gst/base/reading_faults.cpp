// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/reading_faults.hpp"

#include <new>
#include <utility>

#include "src/formats/decoder.hpp"

void ReadingFaults::warn_of_corruption(guint64 at, const char* what) {
  if (std::exchange(warned_of_corruption_, true)) return;
  gst_element_message_full(element_, GST_MESSAGE_WARNING, GST_STREAM_ERROR, code_,
                           g_strdup_printf("The data are corrupt at byte %" G_GUINT64_FORMAT
                                           ": %s. What is whole is read all the same.",
                                           at, what),
                           nullptr, __FILE__, GST_FUNCTION, __LINE__);
}

GstFlowReturn ReadingFaults::fail(const std::exception& error) {
  if (dynamic_cast<const eventcamera::UnsupportedFormat*>(&error) != nullptr)
    GST_ELEMENT_ERROR(element_, STREAM, WRONG_TYPE, ("This cannot be read: %s.", error.what()),
                      (nullptr));
  else if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr)
    GST_ELEMENT_ERROR(element_, RESOURCE, NO_SPACE_LEFT,
                      ("There is not enough memory for the events. Lower buffer-time."), (nullptr));
  else
    gst_element_message_full(element_, GST_MESSAGE_ERROR, GST_STREAM_ERROR, code_,
                             g_strdup("This cannot be read."), g_strdup(error.what()), __FILE__,
                             GST_FUNCTION, __LINE__);
  return GST_FLOW_ERROR;
}
