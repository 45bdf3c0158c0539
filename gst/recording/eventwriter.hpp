// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "gst/eventcamera/eventcamera.h"
#include "src/core/sensor_size.hpp"
#include "src/formats/encoder.hpp"

/// An event file format, and the element that writes it: an event stream in, bytes out.
///
/// The header is a separate buffer, and is part of the caps, so that late joiners can decode the
/// stream. Written times follow the PTS. A flush starts the file over, as in filesink. Header
/// fields that are only known at the end are written if downstream can seek. A stop without EOS
/// warns of the events that the format writes at the end.
struct EventWriterFormat {
  /// Enum property that selects a variant of the format.
  struct Variants {
    const char* property;
    const char* blurb;
    GType (*type)();  ///< enum type
    int default_value;
  };

  const char* type_name;
  const char* long_name;
  const char* description;
  const char* caps;                          ///< output caps
  int max_side = GST_EVENT_CAMERA_MAX_SIDE;  ///< of the sensor
  const Variants* variants = nullptr;
  const Variants* compressions = nullptr;
  bool has_words = false;  ///< has property mtu, which limits the words per buffer

  /// Values of the properties of `variants` and `compressions`.
  struct Choice {
    int variant = 0;
    int compression = 0;
  };

  /// Creates the encoder for a stream with these output caps.
  std::unique_ptr<eventcamera::Encoder> (*create)(eventcamera::SensorSize size, Choice choice,
                                                  const GstCaps* caps);
  /// Fixates the caps (not empty) that the member `caps` and downstream have in common; caps of
  /// words have the size of the sensor. Takes ownership of them and returns fixed caps. Null if
  /// they are always fixed.
  GstCaps* (*fixate)(const GstEventCameraInfo& info, int variant, GstCaps* caps) = nullptr;
};

/// Returns the element type that writes `format`, which must have static storage duration.
GType event_writer_type(const EventWriterFormat& format);
