// SPDX-License-Identifier: LGPL-2.1-or-later
/// The elements that read event files: a table of formats for GstEventReader.

#include "elements/eventcam/files/es_origin.hpp"
#include "features.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "gst/recording/eventreader.hpp"
#include "gst/recording/evt_caps.hpp"
#include "src/formats/atis/atis_bin.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/dat/dat.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/es/es.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/evt/raw.hpp"
#include "src/formats/numpy/npy_decoder.hpp"
#include "src/formats/text/csv_decoder.hpp"
#ifdef HAVE_AEDAT
#include "src/formats/aedat/aedat_decoder.hpp"
#endif
#ifdef HAVE_HDF5
#include "src/formats/hdf5/hdf5_decoder.hpp"
#endif
#ifdef HAVE_NPZ
#include "src/formats/numpy/npz.hpp"
#endif
#ifdef HAVE_ROS
#include "src/formats/ros/bag_decoder.hpp"
#endif

using namespace eventcamera;

namespace {

/// Time unit and columns of a table. Throws UnsupportedFormat.
TableSettings table_settings(const FormatSettings& settings) {
  TableSettings table;
  if (settings.time_unit > 0) table.unit = static_cast<TimeUnit>(settings.time_unit - 1);
  if (settings.column_order.empty()) return table;
  auto columns = columns_of(settings.column_order);
  if (!columns)
    throw UnsupportedFormat("column-order \"" + settings.column_order +
                            "\" must have each of t, x, y and p once, and '-' for others");
  table.columns = *std::move(columns);
  return table;
}

/// For formats whose files may not state the sensor size.
void add_sensor_size(FormatProperties& properties) {
  properties.add_fixed([](FormatSettings& settings) -> int& { return settings.sensor.width; },
                       "width",
                       "Width of the sensor in pixels, for files that do not state it; needs "
                       "height. 0: of the smallest known sensor that contains the events",
                       0, GST_EVENT_CAMERA_MAX_SIDE);
  properties.add_fixed([](FormatSettings& settings) -> int& { return settings.sensor.height; },
                       "height",
                       "Height of the sensor in pixels, for files that do not state it; needs "
                       "width. 0: of the smallest known sensor that contains the events",
                       0, GST_EVENT_CAMERA_MAX_SIDE);
}

void add_table_properties(FormatProperties& properties) {
  add_sensor_size(properties);
  properties.add_fixed(
      &FormatSettings::time_unit, "time-unit",
      "Unit of the times in the file; needed if the file is refused because its "
      "time unit is ambiguous",
      enum_type<int>("GstEventTimeUnit",
                     {{0, "As stated in the file, or detected from its first rows", "auto"},
                      {1, "Seconds", "seconds"},
                      {2, "Milliseconds", "milliseconds"},
                      {3, "Microseconds", "microseconds"},
                      {4, "Nanoseconds", "nanoseconds"}}));
  properties.add_fixed(&FormatSettings::column_order, "column-order",
                       "Meaning of the columns: one letter t, x, y or p each, - for others, as in "
                       "xytp; empty = as stated in the file, or detected from its first rows");
}

/// For words without a header, takes format and size from the caps; files have a header.
std::unique_ptr<Decoder> make_raw_decoder(const GstCaps* caps, const FormatSettings& /*settings*/) {
  if (caps != nullptr) {
    const GstStructure* const structure = gst_caps_get_structure(caps, 0);
    if (const auto words = evt_format_named(gst_structure_get_string(structure, "format"))) {
      SensorSize size;
      gst_structure_get_int(structure, "width", &size.width);
      gst_structure_get_int(structure, "height", &size.height);
      return make_evt_decoder(*words, size);
    }
  }
  return make_prophesee_raw_decoder();
}

}  // namespace

/**
 * SECTION:element-evtdec
 * @title: evtdec
 * @short_description: reads RAW files and EVT words
 *
 * Reads Prophesee RAW files, and words without a header whose format is in the caps: EVT2, EVT2.1,
 * EVT3 and EVT4. Events are output in buffers of #GstEventReader:buffer-duration, with triggers for
 * writers that store them.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventdatenc ! filesink
 * location=recording.dat
 * ]|
 *
 * Since: 0.1
 */
static const EventReaderFormat evt = {
    .type_name = "GstEvtDec",
    .long_name = "Prophesee RAW reader",
    .description = "Reads Prophesee RAW files of events",
    .caps = "application/x-prophesee-raw; " EVT_WORDS_CAPS,
    .has_triggers = true,
    .add_properties = add_sensor_size,
    .make_decoder = make_raw_decoder,
};
GST_ELEMENT_REGISTER_DEFINE(evtdec, "evtdec", GST_RANK_PRIMARY, event_reader_type(evt))

/**
 * SECTION:element-eventdatdec
 * @title: eventdatdec
 * @short_description: reads DAT files
 *
 * Reads Prophesee DAT files, versions 1 and 2. Events are output in buffers of
 * #GstEventReader:buffer-duration, with triggers for writers that store them.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.dat ! eventdatdec ! evtenc ! filesink
 * location=recording.raw
 * ]|
 *
 * Since: 0.1
 */
static const EventReaderFormat dat = {
    .type_name = "GstEventDatDec",
    .long_name = "Prophesee DAT reader",
    .description = "Reads Prophesee DAT files of events",
    .caps = "application/x-prophesee-dat",
    .has_triggers = true,
    .add_properties = add_sensor_size,
    .make_decoder = [](const GstCaps*, const FormatSettings&) -> std::unique_ptr<Decoder> {
      return make_dat_decoder();
    },
};
GST_ELEMENT_REGISTER_DEFINE(eventdatdec, "eventdatdec", GST_RANK_PRIMARY, event_reader_type(dat))

/**
 * SECTION:element-eventesdec
 * @title: eventesdec
 * @short_description: reads Event Stream files
 *
 * Reads Event Stream 2.0 files with DVS events; with ATIS events, without exposures; and with
 * colour events, as ON events without colours. `stats` counts what is skipped. Generic events have
 * no pixel, so their files are refused. Events are output in buffers of
 * #GstEventReader:buffer-duration.
 *
 * Tools disagree about the position of row 0. If the picture is upside down, as with files of
 * faery, set #GstEventEsDec:origin to `top-left`.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.es ! eventesdec ! evtenc ! filesink
 * location=recording.raw
 * ]|
 *
 * Since: 0.1
 */
static const EventReaderFormat es = {
    .type_name = "GstEventEsDec",
    .long_name = "Event Stream reader",
    .description = "Reads Event Stream files of events",
    .caps = "application/x-es",
    .add_properties =
        [](FormatProperties& properties) {
          properties.add_fixed(&FormatSettings::variant, "origin", ES_ORIGIN_BLURB,
                               es_origin_type());
        },
    .make_decoder = [](const GstCaps*, const FormatSettings& settings) -> std::unique_ptr<Decoder> {
      return make_event_stream_decoder(static_cast<EsOrigin>(settings.variant));
    },
};
GST_ELEMENT_REGISTER_DEFINE(eventesdec, "eventesdec", GST_RANK_PRIMARY, event_reader_type(es))

/**
 * SECTION:element-eventatisdec
 * @title: eventatisdec
 * @short_description: reads the .bin files of N-MNIST and N-Caltech101
 *
 * Reads the `.bin` files of N-MNIST and N-Caltech101, which were recorded with an ATIS: five bytes
 * an event. They have no signature, so files are recognised by the order of their times, and those
 * with less than 300 events are not. The sensor size comes from #GstEventAtisDec:width and
 * #GstEventAtisDec:height, or else from downstream's caps; otherwise, it is the smallest known
 * sensor that contains the events. N-MNIST has 34x34 pixels.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=00002.bin ! eventatisdec width=34 height=34 ! evtenc ! filesink
 * location=two.raw
 * ]|
 *
 * Since: 0.1
 */
static const EventReaderFormat atis = {
    .type_name = "GstEventAtisDec",
    .long_name = "N-MNIST reader",
    .description = "Reads the .bin files of N-MNIST and N-Caltech101",
    .caps = "application/x-atis-bin",
    .add_properties = add_sensor_size,
    .make_decoder = [](const GstCaps*, const FormatSettings& settings) -> std::unique_ptr<Decoder> {
      return make_atis_bin_decoder(settings.sensor);
    },
};
GST_ELEMENT_REGISTER_DEFINE(eventatisdec, "eventatisdec", GST_RANK_PRIMARY, event_reader_type(atis))

/**
 * SECTION:element-eventcsvdec
 * @title: eventcsvdec
 * @short_description: reads text files of events
 *
 * Reads text with one event per line. Columns, separators and time unit are detected from the first
 * lines, unless #GstEventCsvDec:column-order and #GstEventCsvDec:time-unit are set. A file whose
 * time unit is in doubt is rejected unless the unit is set, and so is one in which more than one
 * line in a hundred is not an event; the error names the first of them. If the file does not
 * contain the sensor size, it comes from #GstEventCsvDec:width and #GstEventCsvDec:height, or else
 * from downstream's caps; otherwise, it is the smallest known sensor that contains the events, and
 * if later events lie outside it, the caps change. Writers cannot change the size within a file:
 * set it for them.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.csv ! eventcsvdec ! evtenc ! filesink
 * location=events.raw
 * ]|
 *
 * Since: 0.1
 */
static const EventReaderFormat csv = {
    .type_name = "GstEventCsvDec",
    .long_name = "CSV reader",
    .description = "Reads CSV files of events",
    .caps = "application/x-event-csv",
    .add_properties = add_table_properties,
    .make_decoder = [](const GstCaps*, const FormatSettings& settings) -> std::unique_ptr<Decoder> {
      return make_csv_decoder(table_settings(settings));
    },
};
GST_ELEMENT_REGISTER_DEFINE(eventcsvdec, "eventcsvdec", GST_RANK_PRIMARY, event_reader_type(csv))

/**
 * SECTION:element-eventnpydec
 * @title: eventnpydec
 * @short_description: reads NumPy files of events
 *
 * Reads structured NumPy arrays with the fields t, x, y and p, and arrays of the shape (N, 4) or
 * (4, N), whose columns are detected from the first rows, unless #GstEventNpyDec:column-order is
 * set. Integer times are microseconds and fractional ones seconds, unless #GstEventNpyDec:time-unit
 * or a name such as t_ns says otherwise. Arrays do not contain the sensor size: it comes from
 * #GstEventNpyDec:width and #GstEventNpyDec:height, or else from downstream's caps; otherwise, it
 * is the smallest known sensor that contains the events, and if later events lie outside it, the
 * caps change. Writers cannot change the size within a file: set it for them.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=events.npy ! eventnpydec ! evtenc ! filesink
 * location=events.raw
 * ]|
 *
 * Since: 0.1
 */
static const EventReaderFormat npy = {
    .type_name = "GstEventNpyDec",
    .long_name = "NumPy reader",
    .description = "Reads NumPy files of events",
    .caps = "application/x-npy",
    .add_properties = add_table_properties,
    .make_decoder = [](const GstCaps*, const FormatSettings& settings) -> std::unique_ptr<Decoder> {
      return make_npy_decoder(table_settings(settings));
    },
};
GST_ELEMENT_REGISTER_DEFINE(eventnpydec, "eventnpydec", GST_RANK_PRIMARY, event_reader_type(npy))

#ifdef HAVE_NPZ
/**
 * SECTION:element-eventnpzdec
 * @title: eventnpzdec
 * @short_description: reads NumPy archives of events
 *
 * Reads archives of numpy.savez() and numpy.savez_compressed(): arrays named t, x, y and p, or one
 * array as in eventnpydec, with the same properties. Numbers named width and height are the size of
 * the sensor, in pixels, as eventnpzenc writes them. Upstream should support pull mode, as filesrc
 * does. In push mode the archive is collected in memory, up to 256 MiB, and read at its end.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=events.npz ! eventnpzdec ! evtenc ! filesink
 * location=events.raw
 * ]|
 *
 * Since: 0.1
 */
static const EventReaderFormat npz = {
    .type_name = "GstEventNpzDec",
    .long_name = "NumPy archive reader",
    .description = "Reads NumPy archives of events",
    .caps = "application/x-npz",
    .add_properties = add_table_properties,
    .make_decoder =
        [](const GstCaps*, const FormatSettings& settings) {
          return make_npz_decoder(table_settings(settings));
        },
};
GST_ELEMENT_REGISTER_DEFINE(eventnpzdec, "eventnpzdec", GST_RANK_PRIMARY, event_reader_type(npz))
#endif

#ifdef HAVE_HDF5
/**
 * SECTION:element-eventhdf5dec
 * @title: eventhdf5dec
 * @short_description: reads HDF5 files of events
 *
 * Reads the events of HDF5 files from Metavision (compressed with ECF), and of all others in which
 * one search finds datasets of a group that are named t, x, y and p, or the like, or a dataset
 * named events with such members or four columns: DSEC, TUM-VIE, M3ED, MVSEC, v2e, E2VID and
 * others. Of several cameras, the first by name is read, unless #GstEventHdf5Dec:events-path
 * selects another; a message names them. Events are output in buffers of
 * #GstEventReader:buffer-duration, with triggers for writers that store them.
 *
 * The time unit is detected by the name and the numbers of the times, unless
 * #GstEventHdf5Dec:time-unit is set; a file whose time unit is in doubt is rejected.
 *
 * HDF5 files need random access, so upstream should support pull mode, as filesrc does. In push
 * mode the file is collected in memory, up to 256 MiB, and read at its end.
 *
 * Files compressed with Blosc, such as those published by DSEC, need HDF5's Blosc plugin (Debian:
 * hdf5-filter-plugin-blosc-serial).
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.h5 ! eventhdf5dec ! eventrender ! videoconvert !
 * autovideosink
 * ]|
 *
 * Since: 0.1
 */
static const EventReaderFormat hdf5 = {
    .type_name = "GstEventHdf5Dec",
    .long_name = "HDF5 reader",
    .description = "Reads HDF5 files of events: DSEC, TUM-VIE, MVSEC, Metavision, v2e",
    .caps = "application/x-hdf5",
    .has_triggers = true,
    .add_properties =
        [](FormatProperties& properties) {
          add_table_properties(properties);
          properties.add_fixed(&FormatSettings::events_path, "events-path",
                               "Path of the events in the file: of a dataset or a group, such as "
                               "prophesee/right; empty = the first events");
        },
    .make_decoder =
        [](const GstCaps*, const FormatSettings& settings) {
          return make_hdf5_decoder({settings.events_path, table_settings(settings)});
        },
};
GST_ELEMENT_REGISTER_DEFINE(eventhdf5dec, "eventhdf5dec", GST_RANK_PRIMARY, event_reader_type(hdf5))
#endif

#ifdef HAVE_AEDAT
/**
 * SECTION:element-aedatdemux
 * @title: aedatdemux
 * @short_description: reads AEDAT, the files of DAVIS and DVS cameras
 *
 * Splits an AEDAT 4 file into its event streams and video streams. AEDAT 1.0, 2.0 and 3.1 are read
 * as one event stream. Triggers and IMU samples are sent with the events of `events_0`, for writers
 * that store them.
 *
 * PTS are the times of the file, so rewriting a file preserves its times. The segments of all
 * streams start at the first event or frame of any of them, so that playback starts at once and
 * events and frames are in sync. A file with negative times is shifted to start at 0.
 *
 * The file is read in pull mode if upstream supports it, as filesrc does. A table of packets at its
 * end makes seeking fast and the duration exact; without one the duration is exact for files up to
 * 16 MiB, and estimated for longer ones until their end has been read.
 *
 * Corrupt data are skipped; a warning reports the first occurrence, and `stats` counts all.
 *
 * An AEDAT 2.0 file may not name its camera. The layout of addresses is then inferred from the
 * first ones; the sensor size comes from #GstAedatDemux:width and #GstAedatDemux:height, or else
 * from downstream's caps; otherwise, it is the smallest DAVIS that contains the events, with a
 * warning.
 *
 * A stream without a frame or event in the first second may get its pad only with the first one.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=davis.aedat4 ! aedatdemux name=d  d.events_0 ! queue !
 * eventrender ! videoconvert ! autovideosink  d.video_0 ! queue ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
static const EventReaderFormat aedat = {
    .type_name = "GstAedatDemux",
    .long_name = "AEDAT demuxer",
    .description = "Reads events and frames from AEDAT files",
    .caps = "application/x-aedat, version = (int) { 1, 2, 3, 4 }",
    .has_many_streams = true,
    .has_triggers = true,
    .add_properties = add_sensor_size,
    .make_decoder = [](const GstCaps*, const FormatSettings& settings) -> std::unique_ptr<Decoder> {
      return make_aedat_decoder(settings.sensor);
    },
};
GST_ELEMENT_REGISTER_DEFINE(aedatdemux, "aedatdemux", GST_RANK_PRIMARY, event_reader_type(aedat))
#endif

#ifdef HAVE_ROS
/**
 * SECTION:element-eventmcapdemux
 * @title: eventmcapdemux
 * @short_description: reads MCAP files, which are ROS 2 bags
 *
 * Reads events and images from MCAP files of ROS 2 and ROS 1, without ROS: messages
 * event_camera_msgs/EventPacket (with encodings evt3, evt2, evt21, libcaer, libcaer_cmp and mono),
 * dvs_msgs/EventArray and prophesee_event_msgs/EventArray as events, sensor_msgs/Image as video.
 * Chunks may be compressed with LZ4 or Zstandard.
 *
 * The first topic of events in the file is read, and all of images; a message names the others,
 * which #GstEventMcapDemux:topics selects.
 *
 * PTS are the stamps of the messages' headers. Packets have the clock of the camera: their first
 * stamp gives the time of its start, so that intervals between events are exact. Triggers are sent
 * with the events, for writers that store them.
 *
 * An index makes seeks fast and the duration exact. Files without one, and files that were cut, are
 * read up to their end.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=walk.mcap ! eventmcapdemux name=d  d.events_0 ! queue !
 * eventrender ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
static void add_topics(FormatProperties& properties) {
  properties.add_fixed(&FormatSettings::topics, "topics",
                       "Topics of events and images to read, separated by commas; empty = the "
                       "first topic of events in the file, and all of images");
}

static const EventReaderFormat mcap = {
    .type_name = "GstEventMcapDemux",
    .long_name = "MCAP demuxer",
    .description = "Reads events and images from MCAP files, which are ROS 2 bags",
    .caps = "application/x-mcap",
    .has_many_streams = true,
    .has_triggers = true,
    .add_properties = add_topics,
    .make_decoder =
        [](const GstCaps*, const FormatSettings& settings) {
          return make_bag_decoder(settings.topics);
        },
};
GST_ELEMENT_REGISTER_DEFINE(eventmcapdemux, "eventmcapdemux", GST_RANK_PRIMARY,
                            event_reader_type(mcap))

/**
 * SECTION:element-eventbagdemux
 * @title: eventbagdemux
 * @short_description: reads ROS 1 bags, and ROS 2 bags with SQLite
 *
 * Reads events and images from ROS 1 bags (`.bag`, version 2.0, with chunks compressed with
 * bzip2 or LZ4 or not at all), and from ROS 2 bags that are SQLite databases (`.db3`), without
 * ROS. It reads the same messages as eventmcapdemux, and chooses topics in the same way.
 *
 * PTS are the stamps of the messages' headers. Databases need random access, so upstream should
 * support pull mode, as filesrc does; in push mode a database is collected in memory, up to 256
 * MiB, and read at its end. A bag that was not closed has no index, but is read, too.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=walk.bag ! eventbagdemux name=d  d.events_0 ! queue ! eventrender
 * ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
static const EventReaderFormat bag = {
    .type_name = "GstEventBagDemux",
    .long_name = "ROS bag demuxer",
    .description = "Reads events and images from ROS bags",
    .caps = "application/x-rosbag; application/x-rosbag2-db3",
    .has_many_streams = true,
    .has_triggers = true,
    .add_properties = add_topics,
    .make_decoder =
        [](const GstCaps*, const FormatSettings& settings) {
          return make_bag_decoder(settings.topics);
        },
};
GST_ELEMENT_REGISTER_DEFINE(eventbagdemux, "eventbagdemux", GST_RANK_PRIMARY,
                            event_reader_type(bag))
#endif
