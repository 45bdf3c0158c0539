// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventesenc
 * @title: eventesenc
 * @short_description: writes Event Stream files
 *
 * Writes events as an Event Stream 2.0 of DVS events. Silence costs a byte for every 127
 * microseconds.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=90 ! eventsim-diff ! eventesenc ! filesink
 * location=test.es
 * ]|
 */
#include "gst/base/eventencoder.hpp"
#include "src/formats/es/es.hpp"

namespace {

struct GstEventEsEnc {
  GstEventEncoder parent;
};

struct GstEventEsEncClass {
  GstEventEncoderClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEventEsEnc, gst_event_es_enc, GST_TYPE_EVENT_ENCODER)
GST_ELEMENT_REGISTER_DEFINE(eventesenc, "eventesenc", GST_RANK_PRIMARY, gst_event_es_enc_get_type())

static std::unique_ptr<eventcamera::Encoder> create(GstEventEncoder*,
                                                    const GstEventCameraInfo& info,
                                                    const GstCaps*) {
  return eventcamera::make_event_stream_encoder({info.width, info.height});
}

static void gst_event_es_enc_init(GstEventEsEnc*) {}

static void gst_event_es_enc_class_init(GstEventEsEncClass* klass) {
  GstEventEncoderClass* encoder_class = GST_EVENT_ENCODER_CLASS(klass);
  encoder_class->create = create;
  gst_event_encoder_class_add_pads(encoder_class, GST_EVENT_CAMERA_MAX_WIDTH,
                                   GST_EVENT_CAMERA_MAX_HEIGHT, "application/x-es");

  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Event Stream writer",
                                        "Codec/Encoder", "Writes events as Event Stream",
                                        "gst-eventsim");
}
