// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <memory>

#include "gst/eventcamera/eventcamera.h"
#include "src/formats/decoder.hpp"
#include "src/formats/encoder.hpp"

/// A format of event files, for an element that writes it: an event stream in, bytes out.
///
/// The times written are those of the PTS. A flush starts the file over, as in filesink. What ends
/// a file but belongs into its header is written where downstream can seek.
struct EventFileFormat {
  /// A property that chooses among variants of the format.
  struct Variants {
    const char* property;
    const char* nick;
    const char* blurb;
    GType (*type)();  ///< of an enum
    int default_value;
  };

  const char* type_name;
  const char* long_name;
  const char* description;
  const char* caps;  ///< of the output
  int max_width = GST_EVENT_CAMERA_MAX_WIDTH;
  int max_height = GST_EVENT_CAMERA_MAX_HEIGHT;
  const Variants* variants = nullptr;

  /// Makes the encoder for a stream whose output has these caps. May throw.
  std::unique_ptr<eventcamera::Encoder> (*create)(eventcamera::SensorSize size, int variant,
                                                  const GstCaps* caps);
  /// Chooses among the caps (not empty) that `caps` above and downstream have in common; takes
  /// them, and returns fixed ones. May be null: then they are fixed already.
  GstCaps* (*fixate)(const GstEventCameraInfo& info, int variant, GstCaps* caps) = nullptr;
};

/// The type of the elements that write a format, which lives as long as the process.
GType event_writer_type(const EventFileFormat& format);
