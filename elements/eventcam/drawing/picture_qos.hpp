// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <mutex>
#include <optional>

#include "gst/base/event_buffer.hpp"

/// Quality of service of drawn pictures: predicts which ones sinks would drop, and counts them.
class PictureQos {
 public:
  /// Handles a QoS event from downstream, in any thread.
  void handle_event(GstEvent* event) {
    GstQOSType type = GST_QOS_TYPE_UNDERFLOW;
    GstClockTimeDiff late = 0;
    GstClockTime time = GST_CLOCK_TIME_NONE;
    gst_event_parse_qos(event, &type, nullptr, &late, &time);
    // Twice as late, to catch up; a throttle states the time between pictures.
    const GstClockTime factor = type == GST_QOS_TYPE_THROTTLE ? 1 : 2;
    const std::lock_guard lock(mutex_);
    if (GST_CLOCK_TIME_IS_VALID(time))
      earliest_ = late > 0 ? time + factor * static_cast<GstClockTime>(late) : 0;
  }

  /// Counts a picture as drawn or skipped. Returns true if it is skipped, because too late; a
  /// picture without a running time never is.
  bool count_skipped(std::optional<GstClockTime> running_time) {
    GstClockTime earliest = 0;
    {
      const std::lock_guard lock(mutex_);
      earliest = earliest_;
    }
    const bool is_late = running_time && *running_time < earliest;
    ++(is_late ? skipped_ : drawn_);
    if (is_late) lateness_ = GST_CLOCK_DIFF(*running_time, earliest);
    return is_late;
  }

  /// The message that reports the last late picture.
  GstMessage* message(GstElement* element, const EventInterval& picture, GstClockTime running_time,
                      GstClockTime stream_time) const {
    GstMessage* const message =
        gst_message_new_qos(GST_OBJECT(element), FALSE, running_time, stream_time, picture.start,
                            picture.end - picture.start);
    gst_message_set_qos_values(message, lateness_, 1, 1'000'000);
    gst_message_set_qos_stats(message, GST_FORMAT_BUFFERS, drawn_, skipped_);
    return message;
  }

  /// Treats no picture as late until the next QoS event.
  void start_over() {
    const std::lock_guard lock(mutex_);
    earliest_ = 0;
  }
  void reset_counts() { drawn_ = skipped_ = 0; }

 private:
  std::mutex mutex_;           ///< guards earliest_; make no calls while holding it
  GstClockTime earliest_ = 0;  ///< running time before which pictures are too late
  GstClockTimeDiff lateness_ = 0;
  guint64 drawn_ = 0;
  guint64 skipped_ = 0;
};
