// SPDX-License-Identifier: LGPL-2.1-or-later
/// The elements that write event files: a table of formats for GstEventWriter.
#include <vector>

#include "elements/eventcam/files/es_origin.hpp"
#include "features.hpp"
#include "gst/base/properties.hpp"
#include "gst/recording/eventwriter.hpp"
#include "gst/recording/evt_caps.hpp"
#include "src/formats/dat/dat.hpp"
#include "src/formats/es/es.hpp"
#include "src/formats/evt/raw.hpp"
#include "src/formats/numpy/npy_encoder.hpp"
#ifdef HAVE_NPZ
#include "src/formats/numpy/npz.hpp"
#endif
#include "src/formats/text/csv_encoder.hpp"
#ifdef HAVE_ROS
#include "src/formats/ros/mcap_encoder.hpp"
#endif

using namespace eventcamera;

/**
 * SECTION:element-evtenc
 * @title: evtenc
 * @short_description: writes RAW files and EVT words
 *
 * Writes events as a Prophesee RAW file with words of #GstEvtEnc:format. If downstream requests
 * `application/x-event-camera` with the format EVT2, EVT21, EVT3 or EVT4, writes these words
 * without a header. Triggers that arrive with the events are written, too.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 v4l2src ! eventsim-dvs ! evtenc format=EVT3 ! filesink location=out.raw
 * ]|
 *
 * Since: 0.1
 */
static const EventWriterFormat::Variants evt_variants = {
    .property = "format",
    .blurb =
        "EVT words to write; read when the stream begins. Downstream caps that request words "
        "without a header take precedence",
    .type =
        [] {
          return enum_type<EvtFormat>(
              "GstEvtFormat", {{EvtFormat::evt2, "32-bit words, one event each", "EVT2"},
                               {EvtFormat::evt21, "64-bit words, up to 32 events each", "EVT21"},
                               {EvtFormat::evt3, "16-bit words, the most compact", "EVT3"},
                               {EvtFormat::evt4, "32-bit words, vectors of events", "EVT4"}});
        },
    .default_value = static_cast<int>(EvtFormat::evt3),
};

static std::unique_ptr<Encoder> make_evt(SensorSize size, EventWriterFormat::Choice choice,
                                         const GstCaps* caps) {
  const auto* words = gst_structure_get_string(gst_caps_get_structure(caps, 0), "format");
  if (const auto format = evt_format_named(words)) return make_evt_encoder(*format, size);
  return make_prophesee_raw_encoder(static_cast<EvtFormat>(choice.variant), size);
}

/// For words without a header, prefers the format of the property, else any that downstream
/// accepts.
static GstCaps* fixate_evt(const GstEventCameraInfo& info, int variant, GstCaps* caps) {
  caps = gst_caps_make_writable(caps);
  GstStructure* structure = gst_caps_get_structure(caps, 0);
  if (gst_structure_has_name(structure, GST_EVENT_CAMERA_MEDIA_TYPE)) {
    gst_structure_fixate_field_string(structure, "format",
                                      evt_format_name(static_cast<EvtFormat>(variant)));
    if (gst_structure_has_field(structure, "framerate"))
      gst_structure_fixate_field_nearest_fraction(structure, "framerate", info.fps_n, info.fps_d);
    else
      gst_structure_set(structure, "framerate", GST_TYPE_FRACTION, info.fps_n, info.fps_d, nullptr);
  }
  return gst_caps_fixate(caps);
}

static const EventWriterFormat evt = {
    .type_name = "GstEvtEnc",
    .long_name = "Prophesee RAW writer",
    .description = "Writes events as Prophesee RAW, or as EVT words",
    .caps = "application/x-prophesee-raw; " EVT_WORDS_CAPS,
    .max_side = 2048,
    .variants = &evt_variants,
    .has_words = true,
    .create = make_evt,
    .fixate = fixate_evt,
};
GST_ELEMENT_REGISTER_DEFINE(evtenc, "evtenc", GST_RANK_PRIMARY, event_writer_type(evt))

/**
 * SECTION:element-eventdatenc
 * @title: eventdatenc
 * @short_description: writes DAT files
 *
 * Writes events as a DAT file, version 2. Timestamps have 32 bits. A file whose first event is
 * later than 71 minutes, such as one with times since 1970, starts at 0. A pause that readers would
 * misinterpret is removed, with a warning: one of more than 71 minutes, or of more than 35 minutes
 * in which the timestamps wrap.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=90 ! eventsim-dvs ! eventdatenc ! filesink
 * location=test.dat
 * ]|
 *
 * Since: 0.1
 */
static const EventWriterFormat dat = {
    .type_name = "GstEventDatEnc",
    .long_name = "Prophesee DAT writer",
    .description = "Writes events as Prophesee DAT",
    .caps = "application/x-prophesee-dat",
    .create = [](SensorSize size, EventWriterFormat::Choice,
                 const GstCaps*) { return make_dat_encoder(size); },
};
GST_ELEMENT_REGISTER_DEFINE(eventdatenc, "eventdatenc", GST_RANK_PRIMARY, event_writer_type(dat))

/**
 * SECTION:element-eventesenc
 * @title: eventesenc
 * @short_description: writes Event Stream files
 *
 * Writes events as an Event Stream 2.0 file of DVS events. Pauses take one byte per 127
 * microseconds. Tools disagree about the position of row 0: set #GstEventEsEnc:origin for the tool
 * that will read the file.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=90 ! eventsim-dvs ! eventesenc ! filesink
 * location=test.es
 * ]|
 *
 * Since: 0.1
 */
static const EventWriterFormat::Variants es_variants = {
    .property = "origin",
    .blurb = ES_ORIGIN_BLURB ". Read when the stream begins",
    .type = es_origin_type,
    .default_value = static_cast<int>(EsOrigin::bottom_left),
};

static const EventWriterFormat event_stream = {
    .type_name = "GstEventEsEnc",
    .long_name = "Event Stream writer",
    .description = "Writes events as Event Stream",
    .caps = "application/x-es",
    .variants = &es_variants,
    .create =
        [](SensorSize size, EventWriterFormat::Choice choice, const GstCaps*) {
          return make_event_stream_encoder(size, static_cast<EsOrigin>(choice.variant));
        },
};
GST_ELEMENT_REGISTER_DEFINE(eventesenc, "eventesenc", GST_RANK_PRIMARY,
                            event_writer_type(event_stream))

/**
 * SECTION:element-eventcsvenc
 * @title: eventcsvenc
 * @short_description: writes text files of events
 *
 * Writes one line per event, in the #GstEventCsvEnc:format of the tool that will read it. The
 * format `labels` adds the cause and the class of labelled events.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=90 ! eventsim-dvs ! eventcsvenc format=rpg ! filesink
 * location=events.txt
 * ]|
 *
 * Since: 0.1
 */
static GType csv_format_type() {
  static const auto values = [] {
    std::vector<GEnumValue> formats;
    for (const auto& [name, description, format] : csv_formats())
      formats.push_back({static_cast<gint>(formats.size()), description.data(), name.data()});
    formats.push_back({0, nullptr, nullptr});
    return formats;
  }();
  return enum_type("GstEventCsvFormat", values.data());
}

static const EventWriterFormat::Variants csv_variants = {
    .property = "format",
    .blurb = "Columns, separators, time unit and header; read when the stream begins",
    .type = csv_format_type,
    .default_value = 0,
};

static const EventWriterFormat csv = {
    .type_name = "GstEventCsvEnc",
    .long_name = "CSV writer",
    .description = "Writes events as lines of text",
    .caps = "application/x-event-csv",
    .variants = &csv_variants,
    .create = [](SensorSize size, EventWriterFormat::Choice choice,
                 const GstCaps*) -> std::unique_ptr<Encoder> {
      const auto& named = csv_formats()[static_cast<std::size_t>(choice.variant)];
      return make_csv_encoder(named.format, size);
    },
};
GST_ELEMENT_REGISTER_DEFINE(eventcsvenc, "eventcsvenc", GST_RANK_PRIMARY, event_writer_type(csv))

/**
 * SECTION:element-eventnpyenc
 * @title: eventnpyenc
 * @short_description: writes NumPy files of events
 *
 * Writes events as a NumPy array with the fields x, y, t and p. Its header holds the number of
 * events, which is written at the end: the sink must be able to seek, as filesink is. Otherwise
 * eventnpydec can read the file, but numpy.load() cannot.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=90 ! eventsim-dvs ! eventnpyenc ! filesink
 * location=events.npy
 * ]|
 *
 * Since: 0.1
 */
static const EventWriterFormat npy = {
    .type_name = "GstEventNpyEnc",
    .long_name = "NumPy writer",
    .description = "Writes events as NumPy",
    .caps = "application/x-npy",
    .create = [](SensorSize, EventWriterFormat::Choice, const GstCaps*)
        -> std::unique_ptr<Encoder> { return std::make_unique<NpyEncoder>(); },
};
GST_ELEMENT_REGISTER_DEFINE(eventnpyenc, "eventnpyenc", GST_RANK_PRIMARY, event_writer_type(npy))

#ifdef HAVE_NPZ
/**
 * SECTION:element-eventnpzenc
 * @title: eventnpzenc
 * @short_description: writes NumPy archives of events
 *
 * Writes events as a NumPy archive with the arrays t (int64, microseconds), x, y (uint16) and p
 * (uint8, 1 = ON), and the numbers width and height of the sensor, in pixels. If events are
 * labelled, also cause (uint8) and class (uint16), as in GstEventCameraLabel. It is not compressed;
 * its size is 13 bytes per event, and 16 with labels. The sink does not need to seek.
 *
 * An archive holds one array after the other, so until the end of the stream the events are kept in
 * temporary files, in the folder of the environment variable TMPDIR, or else in `/var/tmp`. Without
 * the end of the stream they are lost; if the pipeline is stopped earlier, a warning says how many.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=90 ! eventsim-dvs ! eventnpzenc ! filesink
 * location=events.npz
 * ]|
 *
 * Since: 0.1
 */
static const EventWriterFormat npz = {
    .type_name = "GstEventNpzEnc",
    .long_name = "NumPy archive writer",
    .description =
        "Writes events as a NumPy archive: t in microseconds, x and y in pixels, p, and the "
        "sensor's width and height in pixels",
    .caps = "application/x-npz",
    .create = [](SensorSize size, EventWriterFormat::Choice,
                 const GstCaps*) { return make_npz_encoder(size); },
};
GST_ELEMENT_REGISTER_DEFINE(eventnpzenc, "eventnpzenc", GST_RANK_PRIMARY, event_writer_type(npz))
#endif

#ifdef HAVE_ROS
/**
 * SECTION:element-eventmcapenc
 * @title: eventmcapenc
 * @short_description: writes MCAP files, which are ROS 2 bags
 *
 * Writes events as an MCAP file of ROS 2: messages event_camera_msgs/EventPacket in the topic
 * `/event_camera/events`, with an index, for rosbag2, Foxglove and the tools of event_camera_msgs.
 * ROS is not needed. The times of the messages are the PTS; a packet holds up to 10 ms and can be
 * decoded without those before it. Triggers that arrive with the events are written with
 * #GstEventMcapEnc:format evt3.
 *
 * The sink does not need to seek. The index is written at the end of the stream; without it, the
 * events of the last second are lost, and all others can be read.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=90 ! eventsim-dvs ! eventmcapenc ! filesink
 * location=events.mcap
 * ]|
 *
 * Since: 0.1
 */
static const EventWriterFormat::Variants mcap_variants = {
    .property = "format",
    .blurb = "Encoding of the events in the messages; read when the stream begins",
    .type =
        [] {
          return enum_type<BagEvents>(
              "GstEventBagFormat",
              {{BagEvents::evt3, "EVT3 words, the most compact", "evt3"},
               {BagEvents::mono, "64 bits an event, sensors of any size", "mono"}});
        },
    .default_value = static_cast<int>(BagEvents::evt3),
};

static const EventWriterFormat::Variants mcap_compressions = {
    .property = "compression",
    .blurb = "Compression of the file; read when the stream begins",
    .type =
        [] {
          return enum_type<BagCompression>("GstEventBagCompression",
                                           {{BagCompression::none, "No compression", "none"},
                                            {BagCompression::lz4, "LZ4, fast", "lz4"},
                                            {BagCompression::zstd, "Zstandard, smaller", "zstd"}});
        },
    .default_value = static_cast<int>(BagCompression::none),
};

static const EventWriterFormat mcap = {
    .type_name = "GstEventMcapEnc",
    .long_name = "MCAP writer",
    .description = "Writes events as MCAP, a ROS 2 bag",
    .caps = "application/x-mcap",
    .variants = &mcap_variants,
    .compressions = &mcap_compressions,
    .create =
        [](SensorSize size, EventWriterFormat::Choice choice, const GstCaps*) {
          return make_mcap_encoder({size, static_cast<BagEvents>(choice.variant),
                                    static_cast<BagCompression>(choice.compression)});
        },
};
GST_ELEMENT_REGISTER_DEFINE(eventmcapenc, "eventmcapenc", GST_RANK_PRIMARY, event_writer_type(mcap))
#endif
