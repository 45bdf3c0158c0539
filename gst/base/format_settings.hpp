// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "gst/base/properties.hpp"
#include "src/formats/event_table.hpp"

/// What the application sets for a recording format, read when a file begins. A reader has the
/// properties that its format adds.
struct FormatSettings {
  eventcamera::SensorSize sensor;  ///< if the file does not state it; 0x0: assumed
  int variant = 0;                 ///< an enum of the format's
  int time_unit = 0;               ///< 0: detect, else TimeUnit + 1
  std::string column_order;        ///< empty: detect

  /// Unit and columns of a table. Throws UnsupportedFormat.
  eventcamera::TableSettings table() const;
};

/// The settings of an element that reads recordings.
GuardedSettings<FormatSettings>& format_settings_of(GObject* reader);

using FormatProperties = Properties<format_settings_of>;

/// Adds `width` and `height`, for a format whose files may not state the sensor size.
void add_sensor_size(FormatProperties& properties);

/// Adds `width`, `height`, `time-unit` and `column-order`, for a format of rows of numbers.
void add_table_properties(FormatProperties& properties);
