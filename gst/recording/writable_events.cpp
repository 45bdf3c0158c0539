// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/writable_events.hpp"

#include <stdexcept>

#include "gst/base/properties.hpp"
#include "src/formats/temporary_file.hpp"

using namespace eventcamera;

void WritableEvents::begin_file(SensorSize sensor) {
  sensor_ = sensor;
  latest_ = 0;
  segment_begun_ = false;
  earlier_ = outside_ = {};
  *written_.lock() = {};
}

bool WritableEvents::accepts(SensorSize sensor) const {
  if (sensor == sensor_) return true;
  post_message(element_, GST_MESSAGE_ERROR,
               {GST_STREAM_ERROR_FORMAT, "The sensor size changes from " + in_pixels(sensor_) +
                                             " to " + in_pixels(sensor) +
                                             " within a file. Start a new file for it, or set "
                                             "width and height where the events are read."},
               "new caps after events were written");
  return false;
}

void WritableEvents::begin_segment(const GstSegment& segment, bool in_stream_time) {
  segment_begun_ = true;
  const bool is_known = segment.format == GST_FORMAT_TIME && segment.start <= G_MAXINT64 &&
                        segment.time <= G_MAXINT64;
  offset_ = in_stream_time && is_known ? GST_CLOCK_DIFF(segment.start, segment.time) : 0;
}

Microseconds WritableEvents::time_of(GstClockTime pts) const {
  const auto time = static_cast<GstClockTimeDiff>(std::min<GstClockTime>(pts, G_MAXINT64));
  return std::max<GstClockTimeDiff>(time + std::min(offset_, G_MAXINT64 - time), 0) / 1000;
}

void WritableEvents::report_buffer(GstBuffer* buffer) const {
  post_message(
      element_, GST_MESSAGE_ERROR,
      {GST_STREAM_ERROR_FORMAT,
       "Cannot write a buffer that has no PTS or a partial event. Check the elements upstream."},
      GST_BUFFER_PTS(buffer) > G_MAXINT64
          ? "no PTS"
          : "cannot map " + std::to_string(gst_buffer_get_size(buffer)) +
                " bytes as events of 8 bytes");
}

std::span<const AbsoluteEvent> WritableEvents::pick(std::span<const Event> events,
                                                    Microseconds start,
                                                    std::span<const Label> labels) {
  picked_.clear();
  picked_labels_.clear();
  if (!events.empty() && std::exchange(segment_begun_, false) && written_.lock()->events > 0 &&
      start + events[0].t < latest_)
    throw std::invalid_argument("times start over at " + std::to_string(start + events[0].t) +
                                " us in another segment, and events until " +
                                std::to_string(latest_) +
                                " us are written; write each recording to a file of its own");
  std::size_t before_last_dropped = 0;
  for (const auto& event : events) {
    const AbsoluteEvent absolute{start + event.t, event.x, event.y_p};
    const bool outside = event.x >= sensor_.width || absolute.y() >= sensor_.height;
    if (outside || absolute.t < latest_) {
      ++(outside ? outside_ : earlier_).count;
      before_last_dropped = picked_.size();
      continue;
    }
    latest_ = absolute.t;
    picked_.push_back(absolute);
    if (!labels.empty())
      picked_labels_.push_back(labels[static_cast<std::size_t>(&event - events.data())]);
  }
  if (picked_.size() < events.size())
    GST_CAT_LOG_OBJECT(
        category_, element_,
        "dropped %" G_GSIZE_FORMAT " of %" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT
        ": outside the sensor, or earlier than those written",
        events.size() - picked_.size(), events.size(), GST_TIME_ARGS(nanoseconds(start)));
  if (picked_.size() > before_last_dropped) {
    if (earlier_.reported == 0) warn_of_earlier();
    if (outside_.reported == 0) warn_of_outside();
  }
  written_.lock()->events += picked_.size();
  return picked_;
}

void WritableEvents::end_file() {
  warn_of_earlier();
  warn_of_outside();
}

void WritableEvents::warn_of_earlier() {
  warn(earlier_,
       "earlier than others already written. Timestamps must not decrease; start a new file where "
       "time starts over.",
       "latest time written: " + std::to_string(latest_) + " us");
}

void WritableEvents::warn_of_outside() {
  warn(outside_, "outside the sensor. Correct the size in the caps, " + in_pixels(sensor_) + ".",
       "x or y is past the width or height in the caps");
}

void WritableEvents::warn(Dropped& dropped, const std::string& what, const std::string& cause) {
  if (dropped.count == dropped.reported) return;
  const Report report{code_, "Dropped " + std::to_string(dropped.count) + " event" +
                                 (dropped.count == 1 ? "" : "s") +
                                 (dropped.reported == 0 ? " " : " in total ") + what};
  GST_CAT_WARNING_OBJECT(category_, element_, "%s (%s)", report.text.c_str(), cause.c_str());
  post_message(element_, GST_MESSAGE_WARNING, report, cause);
  dropped.reported = dropped.count;
}

GstStructure* WritableEvents::stats() {
  const Written written = *written_.lock();
  return new_counters("application/x-event-writer-stats", {{"events", written.events},
                                                           {"labels", written.labels},
                                                           {"triggers", written.triggers},
                                                           {"frames", written.frames},
                                                           {"imu-samples", written.imu_samples}});
}

Report WritableEvents::failure(const std::exception& error, const Report& otherwise) {
  if (is_a<std::bad_alloc>(error))
    return {GST_RESOURCE_ERROR_NO_SPACE_LEFT, "Not enough memory to write the events."};
  if (is_a<std::invalid_argument>(error))
    return {GST_STREAM_ERROR_FORMAT,
            std::string("This file format cannot hold the stream: ") + error.what() + "."};
  if (is_a<TemporaryFileError>(error))
    return {GST_RESOURCE_ERROR_WRITE,
            std::string("Cannot keep events in a ") + error.what() +
                ". Set the environment variable TMPDIR to a folder with enough space."};
  return otherwise;
}

OwnedCaps with_stream_header(OwnedCaps caps, GstBuffer* header) {
  GST_BUFFER_FLAG_SET(header, GST_BUFFER_FLAG_HEADER);
  GValue buffer = G_VALUE_INIT;
  g_value_init(&buffer, GST_TYPE_BUFFER);
  gst_value_set_buffer(&buffer, header);
  GValue headers = G_VALUE_INIT;
  g_value_init(&headers, GST_TYPE_ARRAY);
  gst_value_array_append_and_take_value(&headers, &buffer);
  GstCaps* const extended = gst_caps_make_writable(caps.release());
  gst_structure_take_value(gst_caps_get_structure(extended, 0), "streamheader", &headers);
  return OwnedCaps(extended);
}
