// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/eventreader.hpp"

#include <utility>

#include "gst/base/element_type.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/properties.hpp"
#include "gst/base/types.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "gst/recording/file_extensions.hpp"
#include "gst/recording/frame_buffer.hpp"
#include "gst/recording/reader/event_reader.hpp"
#include "src/formats/corruption.hpp"

using namespace eventcamera;

GST_DEBUG_CATEGORY(event_reader_debug);
#define GST_CAT_DEFAULT event_reader_debug

struct GstEventReaderPrivate {
  EventReader* reader;
};

#define GST_TYPE_EVENT_READER (gst_event_reader_get_type())
G_DECLARE_DERIVABLE_TYPE(GstEventReader, gst_event_reader, GST, EVENT_READER, GstElement)

struct _GstEventReaderClass {
  GstElementClass parent_class;
  const EventReaderFormat* format;
};

G_DEFINE_ABSTRACT_TYPE_WITH_CODE(GstEventReader, gst_event_reader, GST_TYPE_ELEMENT,
                                 G_ADD_PRIVATE(GstEventReader)
                                     GST_DEBUG_CATEGORY_INIT(event_reader_debug, "eventreader", 0,
                                                             "readers of recordings"))

static EventReader*& reader_of(GObject* object) {
  return static_cast<GstEventReaderPrivate*>(
             gst_event_reader_get_instance_private(GST_EVENT_READER(object)))
      ->reader;
}

EventReader& event_reader_of(GstObject* element) {
  return *reader_of(G_OBJECT(element));
}

static Guarded<ReaderSettings>& settings_of(GObject* object) {
  return reader_of(object)->settings();
}

Guarded<FormatSettings>& format_settings_of(GObject* reader) {
  return reader_of(reader)->format_settings();
}

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  const auto result =
      GST_ELEMENT_CLASS(gst_event_reader_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) event_reader_of(GST_OBJECT(element)).reset();
  return result;
}

/// Creates the reader here, because the subclass's format is not yet known in init.
static void constructed(GObject* object) {
  reader_of(object) =
      new EventReader(GST_ELEMENT(object), *GST_EVENT_READER_GET_CLASS(object)->format);
  G_OBJECT_CLASS(gst_event_reader_parent_class)->constructed(object);
}

static void finalize(GObject* object) {
  delete reader_of(object);
  G_OBJECT_CLASS(gst_event_reader_parent_class)->finalize(object);
}

static void gst_event_reader_init(GstEventReader*) {}

static void gst_event_reader_class_init(GstEventReaderClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->constructed = constructed;
  object_class->finalize = finalize;
  GST_ELEMENT_CLASS(klass)->change_state = change_state;
  Properties<settings_of>(object_class)
      .add_fixed(&ReaderSettings::buffer_duration, "buffer-duration",
                 "Duration of a buffer of events (nanoseconds, in whole microseconds)", GST_USECOND,
                 10 * GST_SECOND);
  install_stats(
      object_class, [](GObject* object) { return reader_of(object)->stats(); },
      "Counts since the start or the last seek: events, triggers, frames and imu-samples read; "
      "corrupt-places where bytes were skipped; and what was dropped: outside-events, outside the "
      "sensor; late-items, after their buffer was sent; stray-items, at an impossible time. "
      "skipped-items counts exposures and colours of an Event Stream, which are not events");
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_READER, static_cast<GstPluginAPIFlags>(0));
}

static void format_class_init(gpointer klass, gpointer data) {
  const auto& format = *static_cast<const EventReaderFormat*>(data);
  GST_EVENT_READER_CLASS(klass)->format = &format;
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  // A demuxer even of a single stream: its pad is added once the header has given the caps, and
  // players find it as they find the demuxers of video files.
  const char* const name = format.has_many_streams ? "events_%u" : "src";
  add_pad_template(element_class, "sink", GST_PAD_SINK, format.caps);
  add_pad_template(element_class, name, GST_PAD_SRC, FILE_EVENTS_CAPS, GST_PAD_SOMETIMES);
  if (format.has_many_streams)
    add_pad_template(element_class, "video_%u", GST_PAD_SRC, RECORDED_VIDEO_CAPS,
                     GST_PAD_SOMETIMES);
  set_metadata(klass, format.long_name, "Codec/Demuxer", format.description);
  set_input_extensions(element_class, format.caps);
  if (format.add_properties != nullptr) {
    FormatProperties properties(G_OBJECT_CLASS(klass));
    format.add_properties(properties);
  }
}

GType event_reader_type(const EventReaderFormat& format) {
  return row_type(GST_TYPE_EVENT_READER, format.type_name, format_class_init, &format);
}

TableSettings FormatSettings::table() const {
  TableSettings settings;
  if (time_unit > 0) settings.unit = static_cast<TimeUnit>(time_unit - 1);
  if (column_order.empty()) return settings;
  auto columns = columns_of(column_order);
  if (!columns)
    throw UnsupportedFormat("column-order \"" + column_order +
                            "\" must have each of t, x, y and p once, and '-' for others");
  settings.columns = *std::move(columns);
  return settings;
}

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

void add_topics(FormatProperties& properties) {
  properties.add_fixed(&FormatSettings::topics, "topics",
                       "Topics of events and images to read, separated by commas; empty = the "
                       "first topic of events in the file, and all of images");
}

void add_events_path(FormatProperties& properties) {
  properties.add_fixed(&FormatSettings::events_path, "events-path",
                       "Path of the events in the file: of a dataset or a group, such as "
                       "prophesee/right; empty = the first events");
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
