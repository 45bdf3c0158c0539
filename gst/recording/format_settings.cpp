// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/format_settings.hpp"

#include <utility>

#include "gst/base/types.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "src/formats/unsupported_format.hpp"

eventcamera::TableSettings FormatSettings::table() const {
  eventcamera::TableSettings settings;
  if (time_unit > 0) settings.unit = static_cast<eventcamera::TimeUnit>(time_unit - 1);
  if (column_order.empty()) return settings;
  auto columns = eventcamera::columns_of(column_order);
  if (!columns)
    throw eventcamera::UnsupportedFormat(
        "column-order \"" + column_order +
        "\" must have each of t, x, y and p once, and '-' for others");
  settings.columns = *std::move(columns);
  return settings;
}

void add_sensor_size(FormatProperties& properties) {
  properties.add(
      [](FormatSettings& settings) -> int& { return settings.sensor.width; },
      g_param_spec_uint("width", "Width",
                        "Width of the sensor in pixels, for files that do not state it; "
                        "needs height. 0: of the smallest known sensor that contains the "
                        "events",
                        0, GST_EVENT_CAMERA_MAX_SIDE, 0, mutable_ready_flags));
  properties.add([](FormatSettings& settings) -> int& { return settings.sensor.height; },
                 g_param_spec_uint("height", "Height",
                                   "Height of the sensor in pixels, for files that do not state "
                                   "it; needs width. 0: of the smallest known sensor that contains "
                                   "the events",
                                   0, GST_EVENT_CAMERA_MAX_SIDE, 0, mutable_ready_flags));
}

void add_topics(FormatProperties& properties) {
  properties.add(
      &FormatSettings::topics,
      g_param_spec_string("topics", "Topics",
                          "Topics of events and images to read, separated by commas; empty = the "
                          "first topic of events in the file, and all of images",
                          "", mutable_ready_flags));
}

void add_events_path(FormatProperties& properties) {
  properties.add(&FormatSettings::events_path,
                 g_param_spec_string("events-path", "Events path",
                                     "Path of the events in the file: of a dataset or a group, "
                                     "such as prophesee/right; empty = the first events",
                                     "", mutable_ready_flags));
}

static GType time_unit_type() {
  static const GEnumValue units[] = {
      {0, "As stated in the file, or detected from its first rows", "auto"},
      {1, "Seconds", "seconds"},
      {2, "Milliseconds", "milliseconds"},
      {3, "Microseconds", "microseconds"},
      {4, "Nanoseconds", "nanoseconds"},
      {0, nullptr, nullptr},
  };
  return enum_type("GstEventTimeUnit", units);
}

void add_table_properties(FormatProperties& properties) {
  add_sensor_size(properties);
  properties.add(&FormatSettings::time_unit,
                 g_param_spec_enum("time-unit", "Time unit",
                                   "Unit of the times in the file; needed if the file is "
                                   "refused because its time unit is ambiguous",
                                   time_unit_type(), 0, mutable_ready_flags));
  properties.add(
      &FormatSettings::column_order,
      g_param_spec_string("column-order", "Column order",
                          "Meaning of the columns: one letter t, x, y or p each, - for "
                          "others, as in xytp; empty = as stated in the file, or detected from "
                          "its first rows",
                          "", mutable_ready_flags));
}
