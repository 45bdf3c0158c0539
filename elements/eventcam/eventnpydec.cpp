// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventnpydec
 * @title: eventnpydec
 * @short_description: reads NumPy files of events
 *
 * Reads NumPy's structured arrays with the fields t, x, y and p. They do not tell the sensor's
 * size: it is what downstream's caps insist on, or else the smallest known sensor that the first
 * events fit into.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=events.npy ! eventnpydec ! evtenc ! filesink location=events.raw
 * ]|
 */
#include "gst/base/eventdecoder.hpp"
#include "src/formats/numpy/npy_decoder.hpp"

namespace {

struct GstEventNpyDec {
  GstEventDecoder parent;
};

struct GstEventNpyDecClass {
  GstEventDecoderClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEventNpyDec, gst_event_npy_dec, GST_TYPE_EVENT_DECODER)
GST_ELEMENT_REGISTER_DEFINE(eventnpydec, "eventnpydec", GST_RANK_PRIMARY,
                            gst_event_npy_dec_get_type())

static std::unique_ptr<eventcamera::Decoder> create(GstEventDecoder*, const GstCaps*) {
  return std::make_unique<eventcamera::NpyDecoder>();
}

static void gst_event_npy_dec_init(GstEventNpyDec*) {}

static void gst_event_npy_dec_class_init(GstEventNpyDecClass* klass) {
  GstEventDecoderClass* decoder_class = GST_EVENT_DECODER_CLASS(klass);
  decoder_class->create = create;
  gst_event_decoder_class_add_pads(decoder_class, "application/x-npy");

  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "NumPy reader", "Codec/Demuxer",
                                        "Reads NumPy files of events", "gst-eventsim");
}
