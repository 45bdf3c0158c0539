// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventcsvdec
 * @title: eventcsvdec
 * @short_description: reads text files of events
 *
 * Reads text with an event a line: its columns, their separators and the unit of time are found in
 * the first lines. Where they do not tell the sensor's size, it is what downstream's caps insist
 * on, or else the smallest known sensor that the first events fit into.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=events.txt ! eventcsvdec ! evtenc ! filesink location=events.raw
 * ]|
 */
#include "gst/base/eventdecoder.hpp"
#include "src/formats/text/csv_decoder.hpp"

namespace {

struct GstEventCsvDec {
  GstEventDecoder parent;
};

struct GstEventCsvDecClass {
  GstEventDecoderClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEventCsvDec, gst_event_csv_dec, GST_TYPE_EVENT_DECODER)
GST_ELEMENT_REGISTER_DEFINE(eventcsvdec, "eventcsvdec", GST_RANK_PRIMARY,
                            gst_event_csv_dec_get_type())

static std::unique_ptr<eventcamera::Decoder> create(GstEventDecoder*, const GstCaps*) {
  return std::make_unique<eventcamera::CsvDecoder>();
}

static void gst_event_csv_dec_init(GstEventCsvDec*) {}

static void gst_event_csv_dec_class_init(GstEventCsvDecClass* klass) {
  GstEventDecoderClass* decoder_class = GST_EVENT_DECODER_CLASS(klass);
  decoder_class->create = create;
  gst_event_decoder_class_add_pads(decoder_class, "application/x-event-csv");

  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "CSV reader", "Codec/Demuxer",
                                        "Reads CSV files of events", "gst-eventsim");
}
