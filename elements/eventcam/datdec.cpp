// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-datdec
 * @title: datdec
 * @short_description: reads DAT files
 *
 * Reads Prophesee's DAT files, versions 1 and 2. Events come out in buffers of
 * #GstEventDecoder:buffer-time; triggers are counted, and left out.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.dat ! datdec ! evtenc ! filesink location=recording.raw
 * ]|
 */
#include "elements/eventcam/datdec.hpp"

#include "gst/codec/eventdecoder.hpp"
#include "src/codec/dat/dat.hpp"

namespace {

struct GstDatDec {
  GstEventDecoder parent;
};

struct GstDatDecClass {
  GstEventDecoderClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstDatDec, gst_dat_dec, GST_TYPE_EVENT_DECODER)
GST_ELEMENT_REGISTER_DEFINE(datdec, "datdec", GST_RANK_PRIMARY, gst_dat_dec_get_type())

static std::unique_ptr<eventcamera::Decoder> create(GstEventDecoder*, const GstCaps*) {
  return eventcamera::make_dat_decoder();
}

static void gst_dat_dec_init(GstDatDec*) {}

static void gst_dat_dec_class_init(GstDatDecClass* klass) {
  GstEventDecoderClass* decoder_class = GST_EVENT_DECODER_CLASS(klass);
  decoder_class->create = create;
  gst_event_decoder_class_add_pads(decoder_class, "application/x-prophesee-dat");

  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Prophesee DAT reader",
                                        "Codec/Demuxer", "Reads Prophesee DAT files of events",
                                        "gst-eventsim");
}
