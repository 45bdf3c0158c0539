// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/eventreader.hpp"

#include <new>
#include <string>
#include <utility>

#include "gst/base/authors.hpp"
#include "gst/base/event_caps.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/types.hpp"
#include "gst/recording/frame_buffer.hpp"
#include "gst/recording/reader/event_reader.hpp"

GST_DEBUG_CATEGORY(event_reader_debug);
#define GST_CAT_DEFAULT event_reader_debug

using eventcamera::Microseconds;
using eventcamera::RecordingReader;
using eventcamera::UnsupportedFormat;

/* type */

namespace {

struct GstEventReader {
  GstElement parent;
  EventReader* reader;
};

struct GstEventReaderClass {
  GstElementClass parent_class;
  const RecordingFormat* format;
};

}  // namespace

GType gst_event_reader_get_type();
#define GST_TYPE_EVENT_READER (gst_event_reader_get_type())
G_DEFINE_ABSTRACT_TYPE_WITH_CODE(GstEventReader, gst_event_reader, GST_TYPE_ELEMENT,
                                 GST_DEBUG_CATEGORY_INIT(event_reader_debug, "eventreader", 0,
                                                         "readers of recordings"))

EventReader& event_reader_of(gpointer object) {
  return *static_cast<GstEventReader*>(object)->reader;
}

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  const auto result =
      GST_ELEMENT_CLASS(gst_event_reader_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) event_reader_of(element).reset();
  return result;
}

/// Creates the reader here, because the subclass's format is not yet known in init.
static void constructed(GObject* object) {
  auto* const klass = G_TYPE_INSTANCE_GET_CLASS(object, GST_TYPE_EVENT_READER, GstEventReaderClass);
  reinterpret_cast<GstEventReader*>(object)->reader =
      new EventReader(GST_ELEMENT(object), *klass->format);
  G_OBJECT_CLASS(gst_event_reader_parent_class)->constructed(object);
}

static void finalize(GObject* object) {
  delete &event_reader_of(object);
  G_OBJECT_CLASS(gst_event_reader_parent_class)->finalize(object);
}

static void gst_event_reader_init(GstEventReader*) {}

static void gst_event_reader_class_init(GstEventReaderClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->constructed = constructed;
  object_class->finalize = finalize;
  GST_ELEMENT_CLASS(klass)->change_state = change_state;
  install_property(object_class,
                   {[](GObject* object, const GValue* value) {
                      event_reader_of(object).set_buffer_duration(g_value_get_uint64(value));
                    },
                    [](GObject* object, GValue* value) {
                      g_value_set_uint64(value, event_reader_of(object).buffer_duration());
                    }},
                   g_param_spec_uint64(
                       "buffer-duration", "Buffer duration",
                       "Duration of a buffer of events (nanoseconds, in whole microseconds)",
                       GST_USECOND, 10 * GST_SECOND, default_buffer_duration, mutable_ready_flags));
  install_stats(
      object_class, [](GObject* object) { return event_reader_of(object).stats(); },
      "Counts since the start or the last seek: events, triggers, frames and imu-samples read; "
      "corrupt-places where bytes were skipped; and what was dropped: outside-events, outside the "
      "sensor; late-items, after their buffer was sent; stray-items, at an impossible time. "
      "skipped-items counts exposures and colours of an Event Stream, which are not events");
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_READER, static_cast<GstPluginAPIFlags>(0));
}

static void format_class_init(gpointer klass, gpointer data) {
  const auto& format = *static_cast<const RecordingFormat*>(data);
  static_cast<GstEventReaderClass*>(klass)->format = &format;
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  // A demuxer even of a single stream: its pad comes when the header has told the caps, and players
  // find it as they find the demuxers of video files.
  const char* const name = format.has_many_streams ? "events_%u" : "src";
  add_pad_template(element_class, "sink", GST_PAD_SINK, format.caps);
  add_pad_template(element_class, name, GST_PAD_SRC, FILE_EVENTS_CAPS, GST_PAD_SOMETIMES);
  if (format.has_many_streams)
    add_pad_template(element_class, "video_%u", GST_PAD_SRC, RECORDED_VIDEO_CAPS,
                     GST_PAD_SOMETIMES);
  gst_element_class_set_static_metadata(element_class, format.long_name, "Codec/Demuxer",
                                        format.description, EVENTSIM_AUTHORS);
  if (format.add_properties != nullptr) {
    FormatProperties properties(G_OBJECT_CLASS(klass));
    format.add_properties(properties);
  }
}

Guarded<FormatSettings>& format_settings_of(GObject* reader) {
  return event_reader_of(reader).format_settings();
}

GType event_reader_type(const RecordingFormat& format) {
  return row_type(GST_TYPE_EVENT_READER, format.type_name, format_class_init, &format);
}

/* life */

/// Chooses pull mode if upstream supports random access, else push mode.
static gboolean choose_mode(GstPad* sink, GstObject* /*parent*/) {
  GstQuery* const query = gst_query_new_scheduling();
  const bool pulls = gst_pad_peer_query(sink, query) != FALSE &&
                     gst_query_has_scheduling_mode_with_flags(
                         query, GST_PAD_MODE_PULL, GST_SCHEDULING_FLAG_SEEKABLE) != FALSE;
  gst_query_unref(query);
  return gst_pad_activate_mode(sink, pulls ? GST_PAD_MODE_PULL : GST_PAD_MODE_PUSH, TRUE);
}

EventReader::EventReader(GstElement* element, const RecordingFormat& format)
    : element_(element), sink_(add_pad(element, "sink")), format_(format) {
  gst_pad_set_activate_function(sink_, choose_mode);
  gst_pad_set_activatemode_function(
      sink_, +[](GstPad*, GstObject* parent, GstPadMode mode, gboolean active) {
        return event_reader_of(parent).activate(mode, active != FALSE);
      });
  gst_pad_set_chain_function(
      sink_, +[](GstPad*, GstObject* parent, GstBuffer* buffer) {
        return event_reader_of(parent).chain(buffer);
      });
  gst_pad_set_event_function(
      sink_, +[](GstPad*, GstObject* parent, GstEvent* event) {
        return event_reader_of(parent).sink_event(event);
      });
}

EventReader::~EventReader() {
  for (GstEvent* event : held_) gst_event_unref(event);
  gst_clear_event(&stream_start_);
  gst_flow_combiner_free(combiner_);
}

void EventReader::reset() {
  for (GstEvent* event : std::exchange(held_, {})) gst_event_unref(event);
  gst_clear_event(&stream_start_);
  close_recording();
  bytes_.reset();
  caps_.reset();
  flow_ = GST_FLOW_OK;
  warn_of_corruption_.reset();
  warn_of_assumption_.reset();
  told_left_out_.clear();
  dropped_level_.reset();
  for (auto& pad : pads_) {
    pad->reset();
    if (!format_.has_many_streams) continue;
    gst_flow_combiner_remove_pad(combiner_, pad->get());
    if (pad->is_added()) gst_element_remove_pad(element_, pad->get());
  }
  if (format_.has_many_streams) {
    pads_.clear();
    has_no_more_pads_ = false;
  }
  gst_flow_combiner_reset(combiner_);
  group_ = GST_GROUP_ID_INVALID;
  seqnum_ = GST_SEQNUM_INVALID;
  const auto shared = shared_.lock();
  const auto buffer_duration = shared->buffer_duration;
  const bool is_pulling = shared->is_pulling;
  *shared = {};
  shared->buffer_duration = buffer_duration;
  shared->is_pulling = is_pulling;
}

static void unref_caps(GstCaps* caps) {
  if (caps != nullptr) gst_caps_unref(caps);
}

/// Creates the recording, to read a file from its start or a stream of words. May throw.
void EventReader::open_recording() {
  const std::shared_ptr<GstCaps> caps(caps_ ? gst_caps_copy(caps_.get()) : nullptr, unref_caps);
  auto make = [make_decoder = format_.make_decoder, caps, settings = format_settings_.copy()] {
    return make_decoder(caps.get(), settings);
  };
  close_recording();
  const auto length = static_cast<Microseconds>(buffer_duration() / GST_USECOND);
  recording_ = std::make_shared<RecordingReader>(
      make, length, is_timed() ? RecordingReader::Clock::stream : RecordingReader::Clock::file);
  if (bytes_) recording_->open(*bytes_);
  shared_.lock()->recording = recording_;
  GST_DEBUG_OBJECT(element_, "opened in %s mode, with %s of %" GST_PTR_FORMAT,
                   bytes_ ? "pull" : "push", is_timed() ? "the times of upstream" : "its own times",
                   caps_.get());
}

void EventReader::close_recording() {
  recording_.reset();
  pad_of_stream_.clear();
  is_consuming_ = false;
  corrupt_places_ = 0;
  output_due_ = true;
  shared_.lock()->recording.reset();
}

Report EventReader::report_of(const std::exception& error) const {
  if (is_a<UnsupportedFormat>(error))
    return {GST_STREAM_ERROR_WRONG_TYPE,
            std::string("Cannot read this file: ") + error.what() + "."};
  if (is_a<std::bad_alloc>(error))
    return {GST_RESOURCE_ERROR_NO_SPACE_LEFT,
            "There is not enough memory for the events. Lower buffer-duration."};
  return {format_.has_many_streams ? GST_STREAM_ERROR_DEMUX : GST_STREAM_ERROR_DECODE,
          "Cannot read this file. Check that it is complete and that its extension matches its "
          "format."};
}

void wait_until_added(GstElement* element) {
  constexpr int max_milliseconds = 1000;
  for (int i = 0; i < max_milliseconds && gst_element_is_locked_state(element); ++i) g_usleep(1000);
}

/// Within decodebin, eventrender took the events, and the application wanted something else.
Report not_linked() {
  return {GST_STREAM_ERROR_FAILED,
          "No element takes what is read. decodebin draws events as video; for the events "
          "themselves, set decodebin " ASK_FOR_EVENTS "."};
}
