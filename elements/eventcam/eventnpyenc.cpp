// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventnpyenc
 * @title: eventnpyenc
 * @short_description: writes NumPy files of events
 *
 * Writes events as a NumPy array with the fields x, y, t and p. Its header tells how many there
 * are; that is written in the end, so the sink has to be one that can go back, as filesink is.
 * Elsewhere, eventnpydec can read it, and numpy.load() cannot.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=90 ! eventsim-diff ! eventnpyenc ! filesink
 * location=events.npy
 * ]|
 */
#include "gst/base/eventencoder.hpp"
#include "src/formats/numpy/npy_encoder.hpp"

namespace {

struct GstEventNpyEnc {
  GstEventEncoder parent;
};

struct GstEventNpyEncClass {
  GstEventEncoderClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEventNpyEnc, gst_event_npy_enc, GST_TYPE_EVENT_ENCODER)
GST_ELEMENT_REGISTER_DEFINE(eventnpyenc, "eventnpyenc", GST_RANK_PRIMARY,
                            gst_event_npy_enc_get_type())

static std::unique_ptr<eventcamera::Encoder> create(GstEventEncoder*, const GstEventCameraInfo&,
                                                    const GstCaps*) {
  return std::make_unique<eventcamera::NpyEncoder>();
}

static GstEventEncoderPatch patch(const eventcamera::Encoder& encoder) {
  const auto found = static_cast<const eventcamera::NpyEncoder&>(encoder).patch();
  return {found.position, {found.bytes.begin(), found.bytes.end()}};
}

static void gst_event_npy_enc_init(GstEventNpyEnc*) {}

static void gst_event_npy_enc_class_init(GstEventNpyEncClass* klass) {
  GstEventEncoderClass* encoder_class = GST_EVENT_ENCODER_CLASS(klass);
  encoder_class->create = create;
  encoder_class->patch = patch;
  gst_event_encoder_class_add_pads(encoder_class, GST_EVENT_CAMERA_MAX_WIDTH,
                                   GST_EVENT_CAMERA_MAX_HEIGHT, "application/x-npy");

  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "NumPy writer", "Codec/Encoder",
                                        "Writes events as NumPy", "gst-eventsim");
}
