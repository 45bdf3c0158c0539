// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-evtdec
 * @title: evtdec
 * @short_description: reads RAW files and EVT words
 *
 * Reads Prophesee's RAW files, and words without a header whose caps tell what they are: EVT2,
 * EVT2.1, EVT3 and EVT4. Events come out in buffers of #GstEventDecoder:buffer-time; triggers are
 * counted, and left out.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventdatenc ! filesink
 * location=recording.dat
 * ]|
 */
#include "elements/eventcam/evtformat.hpp"
#include "gst/base/eventdecoder.hpp"
#include "src/formats/evt/raw.hpp"

namespace {

struct GstEvtDec {
  GstEventDecoder parent;
};

struct GstEvtDecClass {
  GstEventDecoderClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEvtDec, gst_evt_dec, GST_TYPE_EVENT_DECODER)
GST_ELEMENT_REGISTER_DEFINE(evtdec, "evtdec", GST_RANK_PRIMARY, gst_evt_dec_get_type())

static std::unique_ptr<eventcamera::Decoder> create(GstEventDecoder*, const GstCaps* caps) {
  eventcamera::SensorSize size;
  if (caps != nullptr) {
    const GstStructure* structure = gst_caps_get_structure(caps, 0);
    if (const auto words = evt_format_named(gst_structure_get_string(structure, "format"))) {
      gst_structure_get_int(structure, "width", &size.width);
      gst_structure_get_int(structure, "height", &size.height);
      return eventcamera::make_evt_decoder(*words, size);
    }
  }
  return eventcamera::make_prophesee_raw_decoder();
}

static void gst_evt_dec_init(GstEvtDec*) {}

static void gst_evt_dec_class_init(GstEvtDecClass* klass) {
  GstEventDecoderClass* decoder_class = GST_EVENT_DECODER_CLASS(klass);
  decoder_class->create = create;
  gst_event_decoder_class_add_pads(decoder_class, "application/x-prophesee-raw; " EVT_WORDS_CAPS);

  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Prophesee RAW reader",
                                        "Codec/Demuxer", "Reads Prophesee RAW files of events",
                                        "gst-eventsim");
}
