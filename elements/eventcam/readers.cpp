// SPDX-License-Identifier: LGPL-2.1-or-later
/// The elements that read event files: a table of formats. GstEventReader does the rest.
#include "elements/eventcam/evtformat.hpp"
#include "gst/base/eventreader.hpp"
#include "src/formats/dat/dat.hpp"
#include "src/formats/es/es.hpp"
#include "src/formats/evt/raw.hpp"
#include "src/formats/numpy/npy_decoder.hpp"
#include "src/formats/text/csv_decoder.hpp"
#ifdef HAVE_AEDAT
#include "src/formats/aedat/aedat_reader.hpp"
#endif
#ifdef HAVE_HDF5
#include "src/formats/hdf5/hdf5_reader.hpp"
#endif

using eventcamera::Decoder;
using eventcamera::DecoderReader;
using eventcamera::Reader;

namespace {

/// The reader of a format that its decoder alone can read.
template <std::unique_ptr<Decoder> (*make_decoder)()>
std::unique_ptr<Reader> decoded_by(const GstCaps* /*caps*/) {
  return std::make_unique<DecoderReader>(make_decoder());
}

template <class FormatDecoder>
std::unique_ptr<Reader> decoded_by(const GstCaps* /*caps*/) {
  return std::make_unique<DecoderReader>(std::make_unique<FormatDecoder>());
}

/// Words without a header are what their caps say.
std::unique_ptr<Reader> make_evt_reader(const GstCaps* caps) {
  if (caps != nullptr) {
    const GstStructure* const structure = gst_caps_get_structure(caps, 0);
    if (const auto words = evt_format_named(gst_structure_get_string(structure, "format"))) {
      eventcamera::SensorSize size;
      gst_structure_get_int(structure, "width", &size.width);
      gst_structure_get_int(structure, "height", &size.height);
      return std::make_unique<DecoderReader>(eventcamera::make_evt_decoder(*words, size));
    }
  }
  return std::make_unique<DecoderReader>(eventcamera::make_prophesee_raw_decoder());
}

}  // namespace

/**
 * SECTION:element-evtdec
 * @title: evtdec
 * @short_description: reads RAW files and EVT words
 *
 * Reads Prophesee's RAW files, and words without a header whose caps tell what they are: EVT2,
 * EVT2.1, EVT3 and EVT4. Events come out in buffers of #GstEventReader:buffer-time; triggers
 * are counted and left out.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventdatenc ! filesink
 * location=recording.dat
 * ]|
 */
static const RecordingFormat evt = {
    .type_name = "GstEvtDec",
    .long_name = "Prophesee RAW reader",
    .description = "Reads Prophesee RAW files of events",
    .caps = "application/x-prophesee-raw; " EVT_WORDS_CAPS,
    .make_reader = make_evt_reader,
};
GST_ELEMENT_REGISTER_DEFINE(evtdec, "evtdec", GST_RANK_PRIMARY, event_reader_type(evt))

/**
 * SECTION:element-eventdatdec
 * @title: eventdatdec
 * @short_description: reads DAT files
 *
 * Reads Prophesee's DAT files, versions 1 and 2. Events come out in buffers of
 * #GstEventReader:buffer-time; triggers are counted and left out.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.dat ! eventdatdec ! evtenc ! filesink
 * location=recording.raw
 * ]|
 */
static const RecordingFormat dat = {
    .type_name = "GstEventDatDec",
    .long_name = "Prophesee DAT reader",
    .description = "Reads Prophesee DAT files of events",
    .caps = "application/x-prophesee-dat",
    .make_reader = decoded_by<eventcamera::make_dat_decoder>,
};
GST_ELEMENT_REGISTER_DEFINE(eventdatdec, "eventdatdec", GST_RANK_PRIMARY, event_reader_type(dat))

/**
 * SECTION:element-eventesdec
 * @title: eventesdec
 * @short_description: reads Event Stream files
 *
 * Reads Event Stream 2.0, DVS and ATIS events; of the latter, the changes. Events come out in
 * buffers of #GstEventReader:buffer-time.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.es ! eventesdec ! evtenc ! filesink
 * location=recording.raw
 * ]|
 */
static const RecordingFormat es = {
    .type_name = "GstEventEsDec",
    .long_name = "Event Stream reader",
    .description = "Reads Event Stream files of events",
    .caps = "application/x-es",
    .make_reader = decoded_by<eventcamera::make_event_stream_decoder>,
};
GST_ELEMENT_REGISTER_DEFINE(eventesdec, "eventesdec", GST_RANK_PRIMARY, event_reader_type(es))

/**
 * SECTION:element-eventcsvdec
 * @title: eventcsvdec
 * @short_description: reads text files of events
 *
 * Reads text with an event a line: its columns, their separators and the unit of time are found
 * in the first lines. Where they do not tell the sensor's size, it is what downstream's caps
 * insist on, or else the smallest known sensor that the first events fit into.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=events.txt ! eventcsvdec ! evtenc ! filesink
 * location=events.raw
 * ]|
 */
static const RecordingFormat csv = {
    .type_name = "GstEventCsvDec",
    .long_name = "CSV reader",
    .description = "Reads CSV files of events",
    .caps = "application/x-event-csv",
    .make_reader = decoded_by<eventcamera::CsvDecoder>,
};
GST_ELEMENT_REGISTER_DEFINE(eventcsvdec, "eventcsvdec", GST_RANK_PRIMARY, event_reader_type(csv))

/**
 * SECTION:element-eventnpydec
 * @title: eventnpydec
 * @short_description: reads NumPy files of events
 *
 * Reads NumPy's structured arrays with the fields t, x, y and p. They do not tell the sensor's
 * size: it is what downstream's caps insist on, or else the smallest known sensor that the
 * first events fit into.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=events.npy ! eventnpydec ! evtenc ! filesink
 * location=events.raw
 * ]|
 */
static const RecordingFormat npy = {
    .type_name = "GstEventNpyDec",
    .long_name = "NumPy reader",
    .description = "Reads NumPy files of events",
    .caps = "application/x-npy",
    .make_reader = decoded_by<eventcamera::NpyDecoder>,
};
GST_ELEMENT_REGISTER_DEFINE(eventnpydec, "eventnpydec", GST_RANK_PRIMARY, event_reader_type(npy))

#ifdef HAVE_HDF5
/**
 * SECTION:element-eventhdf5dec
 * @title: eventhdf5dec
 * @short_description: reads HDF5 files of events
 *
 * Reads the events of HDF5 files: DSEC's, Metavision's (compressed with ECF) and v2e's. They
 * come out in buffers of #GstEventReader:buffer-time; triggers are counted and left out.
 *
 * An HDF5 file is read all over the place, so its bytes should be pulled, as from filesrc.
 * Where they are pushed the file is collected in memory, up to 256 MiB, and read at its end.
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
static const RecordingFormat hdf5 = {
    .type_name = "GstEventHdf5Dec",
    .long_name = "HDF5 reader",
    .description = "Reads HDF5 files of events: DSEC, Metavision, v2e",
    .caps = "application/x-hdf5",
    .make_reader = [](const GstCaps*) { return eventcamera::make_hdf5_reader(); },
};
GST_ELEMENT_REGISTER_DEFINE(eventhdf5dec, "eventhdf5dec", GST_RANK_PRIMARY, event_reader_type(hdf5))
#endif

#ifdef HAVE_AEDAT
/**
 * SECTION:element-aedatdemux
 * @title: aedatdemux
 * @short_description: reads AEDAT, the files of DAVIS and DVS cameras
 *
 * Takes an AEDAT 4 file apart into its event streams and its frames. AEDAT 2.0 and 3.1 are read
 * as one event stream. Triggers and IMU samples are counted and left out.
 *
 * PTS are the file's own times, so that nothing is lost where they are written again. The
 * segments of all streams start at one time origin, the first thing that any of them has, so
 * that playback starts at once, and events and frames are in sync. A file with times before 0
 * is moved to begin at 0.
 *
 * A file is pulled where upstream can seek, as filesrc does. A table of packets at its end
 * makes seeking fast and tells the duration; without one the duration is exact for files of up
 * to 16 MiB, and estimated for longer ones until their end was read.
 *
 * Corrupt input is skipped; the first place is reported as a warning, and `stats` counts them.
 *
 * A stream that has no frame or event in the first second may get its pad only when the first
 * one comes.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=davis.aedat4 ! aedatdemux name=d  d.events_0 ! queue !
 * eventrender ! videoconvert ! autovideosink  d.video_0 ! queue ! videoconvert ! autovideosink
 * ]|
 */
static const RecordingFormat aedat = {
    .type_name = "GstAedatDemux",
    .long_name = "AEDAT demuxer",
    .description = "Reads events and frames from AEDAT files",
    .caps = "application/x-aedat, version = (int) { 2, 3, 4 }",
    .has_many_streams = true,
    .make_reader = [](const GstCaps*) -> std::unique_ptr<Reader> {
      return std::make_unique<eventcamera::AedatReader>();
    },
};
GST_ELEMENT_REGISTER_DEFINE(aedatdemux, "aedatdemux", GST_RANK_PRIMARY, event_reader_type(aedat))
#endif
