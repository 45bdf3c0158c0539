// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-esenc
 * @title: esenc
 * @short_description: writes Event Stream files
 *
 * Writes events as an Event Stream 2.0 of DVS events. Silence costs a byte for every 127
 * microseconds.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=90 ! eventsim-diff ! esenc ! filesink location=test.es
 * ]|
 */
#include "elements/eventcam/esenc.hpp"

#include "gst/codec/eventencoder.hpp"
#include "src/codec/es/es.hpp"

namespace {

struct GstEsEnc {
  GstEventEncoder parent;
};

struct GstEsEncClass {
  GstEventEncoderClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEsEnc, gst_es_enc, GST_TYPE_EVENT_ENCODER)
GST_ELEMENT_REGISTER_DEFINE(esenc, "esenc", GST_RANK_PRIMARY, gst_es_enc_get_type())

static std::unique_ptr<eventcamera::Encoder> create(GstEventEncoder*,
                                                    const GstEventCameraInfo& info,
                                                    const GstCaps*) {
  return eventcamera::make_event_stream_encoder({info.width, info.height});
}

static void gst_es_enc_init(GstEsEnc*) {}

static void gst_es_enc_class_init(GstEsEncClass* klass) {
  GstEventEncoderClass* encoder_class = GST_EVENT_ENCODER_CLASS(klass);
  encoder_class->create = create;
  gst_event_encoder_class_add_pads(encoder_class, GST_EVENT_CAMERA_MAX_WIDTH,
                                   GST_EVENT_CAMERA_MAX_HEIGHT, "application/x-es");

  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Event Stream writer",
                                        "Codec/Encoder", "Writes events as Event Stream",
                                        "gst-eventsim");
}
