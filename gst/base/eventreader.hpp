// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <memory>

#include "src/formats/reader.hpp"

/// A format of recordings, for an element that reads it: bytes in, streams of events and video out.
///
/// Events come in buffers of `buffer-time`; a silence is one GAP, however long. PTS are the times
/// of the file, so that nothing is lost where they are written again. The segments of all streams
/// start at the first event or frame of the file, so that running time and stream time begin at 0
/// there, and streams are in sync. A file with times before 0 is moved to begin at 0.
///
/// Bytes are pulled where upstream can seek, as filesrc can: then duration and seeking are exact
/// for files of up to 16 MiB and for those that tell their duration; the duration of others is
/// estimated until their end was read. In push mode, seeking works where upstream can seek to a
/// byte.
///
/// Source pads appear when their streams are known. An element of one stream has a pad "src", which
/// stays after a stop; others have pads "events_%u" and "video_%u".
///
/// Words without a header may come in a TIME segment, as from an encoder or a network. Then times
/// are upstream's: the clock of the words is moved so that the first event of a buffer lies within
/// it.
struct RecordingFormat {
  const char* type_name;
  const char* long_name;
  const char* description;
  const char* caps;  ///< of the input
  bool has_many_streams = false;

  /// Makes the reader of a file, or of a stream with these caps; null where they are not known. May
  /// throw.
  std::unique_ptr<eventcamera::Reader> (*make_reader)(const GstCaps* caps);
};

/// The type of the elements that read a format, which lives as long as the process.
GType event_reader_type(const RecordingFormat& format);
