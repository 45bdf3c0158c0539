// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

#include <memory>

#include "src/formats/byte_source.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/event_file.hpp"

/// The abstract base class of the elements that read event files: bytes in, an event stream out. It
/// does all that GStreamer asks for; a subclass brings a Decoder, or opens an EventFile, and its
/// pad templates.
///
/// Output buffers are intervals of `buffer-time`; a silence is one GAP, however long. Their PTS are
/// the file's own times, so that nothing is lost where they are written again; the segment starts
/// at the first event, so that running time and stream time begin at 0, whenever that was. A file
/// with times before 0 is moved to begin at 0.
///
/// The source pad appears with the first output, and then stays.
///
/// Bytes are pulled where upstream can, as filesrc does: then seeking and duration are exact for
/// files of up to 16 MiB, and the duration of longer ones is estimated until their end was read.
/// Pushed, a file can be sought in where upstream can go to a byte.
///
/// An EventFile is read where its bytes are pulled, and its times are exact. Pushed, it is
/// collected in memory, up to 256 MiB, read at its end, and cannot be sought in.
///
/// Words without a header may come in a TIME segment, as from an encoder or a network. Then times
/// are upstream's: the words' clock is moved so that the first event of a buffer lies within it.
#define GST_TYPE_EVENT_DECODER (gst_event_decoder_get_type())
#define GST_EVENT_DECODER(object) \
  (G_TYPE_CHECK_INSTANCE_CAST((object), GST_TYPE_EVENT_DECODER, GstEventDecoder))
#define GST_EVENT_DECODER_CLASS(klass) \
  (G_TYPE_CHECK_CLASS_CAST((klass), GST_TYPE_EVENT_DECODER, GstEventDecoderClass))
#define GST_EVENT_DECODER_GET_CLASS(object) \
  (G_TYPE_INSTANCE_GET_CLASS((object), GST_TYPE_EVENT_DECODER, GstEventDecoderClass))

GType gst_event_decoder_get_type(void);

struct GstEventDecoderPrivate;

struct GstEventDecoder {
  GstElement parent;
  GstEventDecoderPrivate* priv;
};

struct GstEventDecoderClass {
  GstElementClass parent_class;

  /// Makes the decoder of a file, or of a stream with these caps; null where nobody told any. May
  /// throw. One of this and open() is there.
  std::unique_ptr<eventcamera::Decoder> (*create)(GstEventDecoder* self, const GstCaps* caps);

  /// Opens a file that is no stream of bytes. May throw.
  std::unique_ptr<eventcamera::EventFile> (*open)(std::unique_ptr<eventcamera::ByteSource> bytes);
};

/// For class_init: the pads, of which the sink takes these caps.
void gst_event_decoder_class_add_pads(GstEventDecoderClass* klass, const char* sink_caps);
