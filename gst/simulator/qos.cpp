// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/qos.hpp"

#include <algorithm>

/// Limit of running times.
static constexpr GstClockTimeDiff max_time = G_MAXINT64 / 4;

/// Running time of the clock; none without a clock.
static std::optional<SimulatorQos::Nanoseconds> now(GstBaseTransform* element) {
  const GstClockTime time = gst_element_get_current_running_time(GST_ELEMENT(element));
  if (time > GstClockTime{max_time}) return std::nullopt;
  return static_cast<SimulatorQos::Nanoseconds>(time);
}

void SimulatorQos::take_event(GstBaseTransform* element, GstEvent* event) {
  GstQOSType type = GST_QOS_TYPE_UNDERFLOW;
  GstClockTime start = 0;
  gst_event_parse_qos(event, &type, &proportion_, &lateness_, &start);
  const auto time = now(element);
  if (!time || start > GstClockTime{max_time}) return;
  const auto output = static_cast<Nanoseconds>(start);
  const Nanoseconds difference = std::clamp(lateness_, -max_time, max_time);
  if (type == GST_QOS_TYPE_THROTTLE)
    pacer_.take_throttle(output, difference);
  else
    pacer_.take_lateness(output, difference, *time);
}

GstMessage* SimulatorQos::message(GstBaseTransform* element, GstBuffer* frame,
                                  GstClockTime running_time) {
  const GstClockTime pts = GST_BUFFER_PTS(frame);
  GstMessage* message =
      gst_message_new_qos(GST_OBJECT(element), FALSE, running_time,
                          gst_segment_to_stream_time(&element->segment, GST_FORMAT_TIME, pts), pts,
                          GST_BUFFER_DURATION(frame));
  gst_message_set_qos_values(message, lateness_, proportion_, 1'000'000);
  gst_message_set_qos_stats(message, GST_FORMAT_BUFFERS, frames_, skipped_);
  return message;
}

GstMessage* SimulatorQos::begin(GstBaseTransform* element, GstBuffer* frame, bool skippable) {
  const GstClockTime frame_time =
      gst_segment_to_running_time(&element->segment, GST_FORMAT_TIME, GST_BUFFER_PTS(frame));
  const auto time = now(element);
  if (time && frame_time <= max_time) {
    const auto start = static_cast<Nanoseconds>(frame_time);
    if (pacer_.skip(start, *time) && skippable && is_enabled()) {
      ++skipped_;
      return message(element, frame, frame_time);
    }
    pacer_.begin(is_video_ ? start : last_);
    last_ = start;
  }
  began_ = time;
  return nullptr;
}

SimulatorQos::Nanoseconds SimulatorQos::end_work(GstBaseTransform* element,
                                                 std::optional<Nanoseconds> began) {
  const auto time = now(element);
  const Nanoseconds work =
      time && began ? std::max(*time - std::max(*began, pushed_), Nanoseconds{0}) : 0;
  ++frames_;
  processing_time_ += static_cast<guint64>(work);
  return work;
}

void SimulatorQos::extend(GstBaseTransform* element, GstBuffer* picture,
                          GstClockTime frame_duration) const {
  const auto time = now(element);
  if (!time || !is_enabled()) return;
  const auto period =
      static_cast<GstClockTime>(static_cast<gdouble>(pacer_.period(*time)) * element->segment.rate);
  if (GST_BUFFER_DURATION_IS_VALID(picture)) frame_duration = GST_BUFFER_DURATION(picture);
  if (period > frame_duration) GST_BUFFER_DURATION(picture) = period;
}

void SimulatorQos::end(GstBaseTransform* element) {
  const auto time = now(element);
  if (!time) return;
  pacer_.end(*time);
  pushed_ = *time;
}

void SimulatorQos::reset_stats() {
  frames_ = 0;
  skipped_ = 0;
  processing_time_ = 0;
}

GstStructure* SimulatorQos::stats() const {
  return gst_structure_new("application/x-event-simulator-stats", "frames", G_TYPE_UINT64, frames_,
                           "skipped-frames", G_TYPE_UINT64, skipped_, "processing-time",
                           G_TYPE_UINT64, processing_time_, nullptr);
}
