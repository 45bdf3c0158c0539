// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/writable_events.hpp"

using eventcamera::AbsoluteEvent;
using eventcamera::Microseconds;
using eventcamera::SensorSize;

void WritableEvents::begin_file(SensorSize sensor) {
  sensor_ = sensor;
  latest_ = 0;
  earlier_ = outside_ = {};
}

std::span<const AbsoluteEvent> WritableEvents::pick(std::span<const GstEventCameraEvent> events,
                                                    Microseconds start) {
  picked_.clear();
  std::size_t before_last_left_out = 0;
  for (const auto& event : events) {
    const AbsoluteEvent stamped{start + event.t, event.x, event.y_p};
    const bool outside = event.x >= sensor_.width || stamped.y() >= sensor_.height;
    if (outside || stamped.t < latest_) {
      ++(outside ? outside_ : earlier_).count;
      before_last_left_out = picked_.size();
      continue;
    }
    latest_ = stamped.t;
    picked_.push_back(stamped);
  }
  if (picked_.size() > before_last_left_out) {
    if (earlier_.told == 0) tell_of_earlier();
    if (outside_.told == 0) tell_of_outside();
  }
  return picked_;
}

void WritableEvents::end_file() {
  tell_of_earlier();
  tell_of_outside();
}

void WritableEvents::tell_of_earlier() {
  if (earlier_.count == earlier_.told) return;
  tell(earlier_,
       "They are earlier than others that are written, and the times of a file only rise: write "
       "what begins anew to a file of its own.");
}

void WritableEvents::tell_of_outside() {
  if (outside_.count == outside_.told) return;
  tell(outside_, "They lie outside the sensor, which the caps say has " +
                     std::to_string(sensor_.width) + "x" + std::to_string(sensor_.height) +
                     " pixels: give them its true size.");
}

void WritableEvents::tell(LeftOut& left_out, const std::string& why) {
  gst_element_message_full(
      element_, GST_MESSAGE_WARNING, GST_STREAM_ERROR, code_,
      g_strdup_printf("Events left out%s: %" G_GUINT64_FORMAT ". %s",
                      left_out.told == 0 ? "" : " in all", left_out.count, why.c_str()),
      nullptr, __FILE__, GST_FUNCTION, __LINE__);
  left_out.told = left_out.count;
}
