// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "gst/base/properties.hpp"
#include "src/formats/event_table.hpp"

/// User-settable values of a recording format, read at the start of a file. A reader has only the
/// properties that its format adds.
struct FormatSettings {
  eventcamera::SensorSize sensor;  ///< used if the file does not state it; 0x0: guessed
  int variant = 0;                 ///< format-specific enum
  int time_unit = 0;               ///< 0: detect, else TimeUnit + 1
  std::string column_order;        ///< empty: detect
  std::string topics;              ///< of a bag, separated by commas; empty: the usual ones
  std::string events_path;         ///< in an HDF5 file; empty: the first events

  /// Time unit and columns of a table. Throws UnsupportedFormat.
  eventcamera::TableSettings table() const;
};

/// Settings of a reader element.
Guarded<FormatSettings>& format_settings_of(GObject* reader);

using FormatProperties = Properties<format_settings_of>;

/// Adds `width` and `height`, for formats whose files may not state the sensor size.
void add_sensor_size(FormatProperties& properties);

/// Adds `topics`, for bags.
void add_topics(FormatProperties& properties);

/// Adds `events-path`, for HDF5.
void add_events_path(FormatProperties& properties);

/// Adds `width`, `height`, `time-unit` and `column-order`, for tables.
void add_table_properties(FormatProperties& properties);
