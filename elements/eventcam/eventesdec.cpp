// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventesdec
 * @title: eventesdec
 * @short_description: reads Event Stream files
 *
 * Reads Event Stream 2.0, DVS and ATIS events; of the latter, the changes. Events come out in
 * buffers of #GstEventDecoder:buffer-time.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.es ! eventesdec ! evtenc ! filesink
 * location=recording.raw
 * ]|
 */
#include "gst/base/eventdecoder.hpp"
#include "src/formats/es/es.hpp"

namespace {

struct GstEventEsDec {
  GstEventDecoder parent;
};

struct GstEventEsDecClass {
  GstEventDecoderClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEventEsDec, gst_event_es_dec, GST_TYPE_EVENT_DECODER)
GST_ELEMENT_REGISTER_DEFINE(eventesdec, "eventesdec", GST_RANK_PRIMARY, gst_event_es_dec_get_type())

static std::unique_ptr<eventcamera::Decoder> create(GstEventDecoder*, const GstCaps*) {
  return eventcamera::make_event_stream_decoder();
}

static void gst_event_es_dec_init(GstEventEsDec*) {}

static void gst_event_es_dec_class_init(GstEventEsDecClass* klass) {
  GstEventDecoderClass* decoder_class = GST_EVENT_DECODER_CLASS(klass);
  decoder_class->create = create;
  gst_event_decoder_class_add_pads(decoder_class, "application/x-es");

  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Event Stream reader",
                                        "Codec/Demuxer", "Reads Event Stream files of events",
                                        "gst-eventsim");
}
