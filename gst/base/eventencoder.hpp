// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <memory>
#include <vector>

#include "gst/eventcamera/eventcamera.h"
#include "src/formats/encoder.hpp"

/// The abstract base class of the elements that write event files: an event stream in, bytes out. A
/// subclass brings an Encoder and its pad templates.
///
/// The times written are those of the PTS. A flush begins the file anew, as filesink does. Events
/// that are earlier than what is written, or lie outside the sensor, are left out, and told of.
#define GST_TYPE_EVENT_ENCODER (gst_event_encoder_get_type())
#define GST_EVENT_ENCODER(object) \
  (G_TYPE_CHECK_INSTANCE_CAST((object), GST_TYPE_EVENT_ENCODER, GstEventEncoder))
#define GST_EVENT_ENCODER_CLASS(klass) \
  (G_TYPE_CHECK_CLASS_CAST((klass), GST_TYPE_EVENT_ENCODER, GstEventEncoderClass))
#define GST_EVENT_ENCODER_GET_CLASS(object) \
  (G_TYPE_INSTANCE_GET_CLASS((object), GST_TYPE_EVENT_ENCODER, GstEventEncoderClass))

GType gst_event_encoder_get_type(void);

struct GstEventEncoderPrivate;

/// Bytes that are written over others.
struct GstEventEncoderPatch {
  guint64 position;
  std::vector<guint8> bytes;
};

struct GstEventEncoder {
  GstElement parent;
  GstEventEncoderPrivate* priv;
};

struct GstEventEncoderClass {
  GstElementClass parent_class;

  /// Makes the encoder for a stream; `caps` are those of its output. May throw.
  std::unique_ptr<eventcamera::Encoder> (*create)(GstEventEncoder* self,
                                                  const GstEventCameraInfo& info,
                                                  const GstCaps* caps);
  /// Chooses among the caps (not empty) that the source pad's template and downstream have in
  /// common; takes them, and returns fixed ones. May be null: then they are fixed already.
  GstCaps* (*fixate)(GstEventEncoder* self, const GstEventCameraInfo& info, GstCaps* caps);
  /// What only the end of the stream tells, and is written where downstream can go back. May be
  /// null.
  GstEventEncoderPatch (*patch)(const eventcamera::Encoder& encoder);
};

/// For class_init: the pads. The sink takes sensors of up to this size, the source gives these
/// caps.
void gst_event_encoder_class_add_pads(GstEventEncoderClass* klass, int max_width, int max_height,
                                      const char* src_caps);
