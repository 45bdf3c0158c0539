// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>

#include "gst/base/guarded.hpp"
#include "gst/base/properties.hpp"
#include "src/formats/decoder.hpp"

/// User-settable values of a recording format, read at the start of a file. A reader has only the
/// properties that its format adds.
struct FormatSettings {
  eventcamera::SensorSize sensor;  ///< used if the file does not state it; 0x0: guessed
  int variant = 0;                 ///< format-specific enum
  int time_unit = 0;               ///< 0: detect, else TimeUnit + 1
  std::string column_order;        ///< empty: detect
  std::string topics;              ///< of a bag, separated by commas; empty: the usual ones
  std::string events_path;         ///< in an HDF5 file; empty: the first events
};

Guarded<FormatSettings>& format_settings_of(GObject* reader);

using FormatProperties = Properties<format_settings_of>;

/// A recording format, and the element that reads it: bytes in, streams of events and video out.
///
/// Events come in buffers of duration `buffer-duration`; a silence of any length is one GAP. PTS
/// are the times of the file, so that they survive when written again. The segments of all streams
/// start at the first event or frame of the file, so that running time and stream time are 0 there
/// and streams are in sync. A file with negative times is shifted to start at 0.
///
/// Bytes are pulled if upstream supports it, as filesrc does: duration and seeking are then exact
/// for files up to 16 MiB and those that store their duration; the duration of other files is
/// estimated until their end has been read. In push mode, seeking works if upstream can seek in
/// bytes.
///
/// Source pads appear once their streams are known. An element with a single stream has a pad
/// "src", which it keeps after a stop; others have pads "events_%u" and "video_%u".
///
/// Triggers and IMU samples precede the events of their interval; see sensor_events.hpp.
///
/// Words without a header may arrive in a TIME segment, as from an encoder or a network. Times are
/// then upstream's: the clock of the words is shifted so that the first event of a buffer lies
/// within that buffer's interval.
struct EventReaderFormat {
  const char* type_name;
  const char* long_name;
  const char* description;
  const char* caps;  ///< input caps
  bool has_many_streams = false;
  bool has_triggers = false;  ///< announced to writers, although a file may have none
  void (*add_properties)(FormatProperties& properties) = nullptr;

  /// Creates a reader for a file or a stream with these caps; `caps` is null if unknown.
  std::unique_ptr<eventcamera::Decoder> (*make_decoder)(const GstCaps* caps,
                                                        const FormatSettings& settings);
};

/// Returns the element type that reads `format`, which must have static storage duration.
GType event_reader_type(const EventReaderFormat& format);
