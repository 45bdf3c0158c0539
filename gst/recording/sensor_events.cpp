// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/sensor_events.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>

#include "gst/eventcamera/eventcamera.h"
#include "src/formats/chunker.hpp"

using namespace eventcamera;

static_assert(sizeof(GstEventCameraTrigger) == 16);
static_assert(sizeof(GstEventCameraImuSample) == sizeof(ImuSample) &&
                  offsetof(GstEventCameraImuSample, temperature) ==
                      offsetof(ImuSample, temperature) &&
                  offsetof(GstEventCameraImuSample, magnetic_field) ==
                      offsetof(ImuSample, magnetic_field),
              "the core's IMU samples are passed to applications unchanged");

template <class Record>
static GstEvent* new_event(GstEvent* create(GBytes*), std::span<const Record> records) {
  GBytes* const bytes = g_bytes_new(records.data(), records.size_bytes());
  GstEvent* const event = create(bytes);
  g_bytes_unref(bytes);
  return event;
}

/// The records in `bytes`, which it unrefs; without records with a time out of range.
template <class Record>
static std::optional<std::vector<Record>> records_in(GBytes* bytes) {
  if (bytes == nullptr) return std::nullopt;
  gsize size = 0;
  const auto* const data = static_cast<const Record*>(g_bytes_get_data(bytes, &size));
  std::vector<Record> records(data, data + size / sizeof(Record));
  g_bytes_unref(bytes);
  std::erase_if(records, [](const Record& record) { return !Chunker::is_time(record.t); });
  return records;
}

GstEvent* new_sensor_event(std::span<const Trigger> triggers) {
  std::vector<GstEventCameraTrigger> records;
  for (const auto& trigger : triggers)
    records.push_back({trigger.t, trigger.id, trigger.rising ? 1U : 0U});
  return new_event<GstEventCameraTrigger>(gst_event_new_event_camera_triggers, records);
}

GstEvent* new_sensor_event(std::span<const ImuSample> samples) {
  return new_event(gst_event_new_event_camera_imu_samples, samples);
}

bool is_sensor_event(GstEvent* event) {
  return triggers_of(event) || imu_samples_of(event);
}

std::optional<std::vector<Trigger>> triggers_of(GstEvent* event) {
  const auto records =
      records_in<GstEventCameraTrigger>(gst_event_get_event_camera_triggers(event));
  if (!records) return std::nullopt;
  std::vector<Trigger> triggers;
  std::ranges::transform(
      *records, std::back_inserter(triggers), [](const GstEventCameraTrigger& record) {
        return Trigger{record.t, static_cast<guint16>(record.input), record.is_rising != 0};
      });
  return triggers;
}

std::optional<std::vector<ImuSample>> imu_samples_of(GstEvent* event) {
  return records_in<ImuSample>(gst_event_get_event_camera_imu_samples(event));
}
