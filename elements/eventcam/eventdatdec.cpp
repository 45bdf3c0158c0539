// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventdatdec
 * @title: eventdatdec
 * @short_description: reads DAT files
 *
 * Reads Prophesee's DAT files, versions 1 and 2. Events come out in buffers of
 * #GstEventDecoder:buffer-time; triggers are counted, and left out.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.dat ! eventdatdec ! evtenc ! filesink
 * location=recording.raw
 * ]|
 */
#include "gst/base/eventdecoder.hpp"
#include "src/formats/dat/dat.hpp"

namespace {

struct GstEventDatDec {
  GstEventDecoder parent;
};

struct GstEventDatDecClass {
  GstEventDecoderClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEventDatDec, gst_event_dat_dec, GST_TYPE_EVENT_DECODER)
GST_ELEMENT_REGISTER_DEFINE(eventdatdec, "eventdatdec", GST_RANK_PRIMARY,
                            gst_event_dat_dec_get_type())

static std::unique_ptr<eventcamera::Decoder> create(GstEventDecoder*, const GstCaps*) {
  return eventcamera::make_dat_decoder();
}

static void gst_event_dat_dec_init(GstEventDatDec*) {}

static void gst_event_dat_dec_class_init(GstEventDatDecClass* klass) {
  GstEventDecoderClass* decoder_class = GST_EVENT_DECODER_CLASS(klass);
  decoder_class->create = create;
  gst_event_decoder_class_add_pads(decoder_class, "application/x-prophesee-dat");

  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Prophesee DAT reader",
                                        "Codec/Demuxer", "Reads Prophesee DAT files of events",
                                        "gst-eventsim");
}
