// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/sensor_events.hpp"

#include <algorithm>
#include <cstring>
#include <iterator>

#include "src/formats/chunker.hpp"

using eventcamera::Chunker;
using eventcamera::ImuSample;
using eventcamera::Trigger;

static const char* const triggers_name = "GstEventCameraTriggers";
static const char* const imu_name = "GstEventCameraImu";
static const char* const field = "records";

/// Record of a trigger. That of an IMU sample is the sample itself.
struct TriggerRecord {
  gint64 t;
  guint32 id;
  guint32 is_rising;
};
static_assert(sizeof(TriggerRecord) == 16 && sizeof(ImuSample) == 48);

template <class Record>
static GstEvent* new_event(const char* name, std::span<const Record> records) {
  GBytes* const bytes = g_bytes_new(records.data(), records.size_bytes());
  GstStructure* const structure = gst_structure_new(name, field, G_TYPE_BYTES, bytes, nullptr);
  g_bytes_unref(bytes);
  return gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, structure);
}

static bool is_named(GstEvent* event, const char* name) {
  return GST_EVENT_TYPE(event) == GST_EVENT_CUSTOM_DOWNSTREAM && gst_event_has_name(event, name);
}

/// Skips truncated records, and records with a time out of range.
template <class Record>
static std::optional<std::vector<Record>> records_of(GstEvent* event, const char* name) {
  if (!is_named(event, name)) return std::nullopt;
  std::vector<Record> records;
  const GValue* const value = gst_structure_get_value(gst_event_get_structure(event), field);
  if (value == nullptr || !G_VALUE_HOLDS(value, G_TYPE_BYTES)) return records;
  gsize size = 0;
  const gconstpointer data =
      g_bytes_get_data(static_cast<GBytes*>(g_value_get_boxed(value)), &size);
  records.resize(size / sizeof(Record));
  if (!records.empty()) std::memcpy(records.data(), data, records.size() * sizeof(Record));
  std::erase_if(records, [](const Record& record) { return !Chunker::is_time(record.t); });
  return records;
}

GstEvent* new_sensor_event(std::span<const Trigger> triggers) {
  std::vector<TriggerRecord> records;
  for (const auto& trigger : triggers)
    records.push_back({trigger.t, trigger.id, trigger.rising ? 1U : 0U});
  return new_event<TriggerRecord>(triggers_name, records);
}

GstEvent* new_sensor_event(std::span<const ImuSample> samples) {
  return new_event(imu_name, samples);
}

bool is_sensor_event(GstEvent* event) {
  return is_named(event, triggers_name) || is_named(event, imu_name);
}

std::optional<std::vector<Trigger>> triggers_of(GstEvent* event) {
  const auto records = records_of<TriggerRecord>(event, triggers_name);
  if (!records) return std::nullopt;
  std::vector<Trigger> triggers;
  std::ranges::transform(*records, std::back_inserter(triggers), [](const TriggerRecord& record) {
    return Trigger{record.t, static_cast<guint16>(record.id), record.is_rising != 0};
  });
  return triggers;
}

std::optional<std::vector<ImuSample>> imu_samples_of(GstEvent* event) {
  return records_of<ImuSample>(event, imu_name);
}
