// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventdatenc
 * @title: eventdatenc
 * @short_description: writes DAT files
 *
 * Writes events as a DAT file of version 2. Its times have 32 bits: what is silent for more than 35
 * minutes may be read as silent for 71 minutes less.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=90 ! eventsim-diff ! eventdatenc ! filesink
 * location=test.dat
 * ]|
 */
#include "gst/base/eventencoder.hpp"
#include "src/formats/dat/dat.hpp"

namespace {

struct GstEventDatEnc {
  GstEventEncoder parent;
};

struct GstEventDatEncClass {
  GstEventEncoderClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEventDatEnc, gst_event_dat_enc, GST_TYPE_EVENT_ENCODER)
GST_ELEMENT_REGISTER_DEFINE(eventdatenc, "eventdatenc", GST_RANK_PRIMARY,
                            gst_event_dat_enc_get_type())

static std::unique_ptr<eventcamera::Encoder> create(GstEventEncoder*,
                                                    const GstEventCameraInfo& info,
                                                    const GstCaps*) {
  return eventcamera::make_dat_encoder({info.width, info.height});
}

static void gst_event_dat_enc_init(GstEventDatEnc*) {}

static void gst_event_dat_enc_class_init(GstEventDatEncClass* klass) {
  GstEventEncoderClass* encoder_class = GST_EVENT_ENCODER_CLASS(klass);
  encoder_class->create = create;
  gst_event_encoder_class_add_pads(encoder_class, 16384, 16384, "application/x-prophesee-dat");

  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Prophesee DAT writer",
                                        "Codec/Encoder", "Writes events as Prophesee DAT",
                                        "gst-eventsim");
}
