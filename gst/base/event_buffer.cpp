// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/event_buffer.hpp"

#include <algorithm>

using namespace eventcamera;

static GstClockTime time_of_last_event(GstBuffer* buffer) {
  const gsize size = gst_buffer_get_size(buffer);
  GstEventCameraEvent last = {};
  if (size >= sizeof last) gst_buffer_extract(buffer, size - sizeof last, &last, sizeof last);
  return last.t * GST_USECOND;
}

std::optional<EventInterval> interval_of(GstBuffer* buffer) {
  const GstClockTime start = GST_BUFFER_PTS(buffer);
  if (!GST_CLOCK_TIME_IS_VALID(start) || start > G_MAXINT64) return std::nullopt;
  const GstClockTime duration = GST_BUFFER_DURATION_IS_VALID(buffer) ? GST_BUFFER_DURATION(buffer)
                                                                     : time_of_last_event(buffer);
  return EventInterval{start, start + std::min(duration, GstClockTime{G_MAXINT64} - start)};
}

static std::span<Label> labels_in(const GstEventCameraLabelMeta* meta) {
  return {reinterpret_cast<Label*>(meta->labels), meta->n_labels};
}

std::span<Label> labels_of(GstBuffer* buffer) {
  const auto* meta = gst_buffer_get_event_camera_label_meta(buffer);
  if (meta == nullptr) return {};
  return labels_in(meta);
}

std::span<Label> add_labels(GstBuffer* buffer, gsize events) {
  const auto* meta = gst_buffer_add_event_camera_label_meta(buffer, nullptr, events);
  if (meta == nullptr) throw std::bad_alloc();
  return labels_in(meta);
}

void truncate_events(GstBuffer* buffer, gsize count) {
  if (auto* meta = gst_buffer_get_event_camera_label_meta(buffer))
    gst_event_camera_label_meta_truncate(meta, count);
  else if (auto* invalid = gst_buffer_get_meta(buffer, GST_EVENT_CAMERA_LABEL_META_API_TYPE))
    gst_buffer_remove_meta(buffer, invalid);  // the number of labels must not match by chance
  gst_buffer_set_size(buffer, static_cast<gssize>(count * sizeof(GstEventCameraEvent)));
}
