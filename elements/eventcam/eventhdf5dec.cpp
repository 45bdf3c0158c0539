// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventhdf5dec
 * @title: eventhdf5dec
 * @short_description: reads HDF5 files of events
 *
 * Reads the events of HDF5 files: DSEC's, Metavision's (compressed with ECF) and v2e's. They come
 * out in buffers of #GstEventDecoder:buffer-time; triggers are counted, and left out.
 *
 * An HDF5 file is read all over the place, so its bytes have to be pulled, as from filesrc. Where
 * they are pushed the file is collected in memory, up to 256 MiB, and read at its end.
 *
 * Files with Blosc, as DSEC publishes them, need HDF5's plugin of that name (Debian:
 * hdf5-filter-plugin-blosc-serial).
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=events.h5 ! eventhdf5dec ! eventrender ! videoconvert !
 * autovideosink
 * ]|
 */
#include "gst/base/eventdecoder.hpp"
#include "src/formats/hdf5/hdf5_reader.hpp"

namespace {

struct GstEventHdf5Dec {
  GstEventDecoder parent;
};

struct GstEventHdf5DecClass {
  GstEventDecoderClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEventHdf5Dec, gst_event_hdf5_dec, GST_TYPE_EVENT_DECODER)
GST_ELEMENT_REGISTER_DEFINE(eventhdf5dec, "eventhdf5dec", GST_RANK_PRIMARY,
                            gst_event_hdf5_dec_get_type())

static std::unique_ptr<eventcamera::EventFile> open(
    std::unique_ptr<eventcamera::ByteSource> bytes) {
  return std::make_unique<eventcamera::Hdf5Reader>(std::move(bytes));
}

static void gst_event_hdf5_dec_init(GstEventHdf5Dec*) {}

static void gst_event_hdf5_dec_class_init(GstEventHdf5DecClass* klass) {
  GstEventDecoderClass* decoder_class = GST_EVENT_DECODER_CLASS(klass);
  decoder_class->open = open;
  gst_event_decoder_class_add_pads(decoder_class, "application/x-hdf5");

  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "HDF5 reader", "Codec/Demuxer",
                                        "Reads HDF5 files of events: DSEC, Metavision, v2e",
                                        "gst-eventsim");
}
