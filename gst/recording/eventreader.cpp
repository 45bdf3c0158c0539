// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/eventreader.hpp"

#include <gst/base/gstflowcombiner.h>

#include <algorithm>
#include <exception>
#include <map>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "gst/base/authors.hpp"
#include "gst/base/buffer_bytes.hpp"
#include "gst/base/errors.hpp"
#include "gst/base/event_buffer.hpp"
#include "gst/base/guarded.hpp"
#include "gst/base/latency.hpp"
#include "gst/base/owned.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/properties.hpp"
#include "gst/base/seek_request.hpp"
#include "gst/base/types.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "gst/recording/frame_buffer.hpp"
#include "gst/recording/pad_bytes.hpp"
#include "gst/recording/reader_pad.hpp"
#include "gst/recording/sensor_events.hpp"
#include "src/formats/recording_reader.hpp"

GST_DEBUG_CATEGORY_STATIC(event_reader_debug);
#define GST_CAT_DEFAULT event_reader_debug

using eventcamera::Microseconds;
using eventcamera::RecordingReader;
using eventcamera::SeekPoint;
using eventcamera::StreamKind;
using eventcamera::UnsupportedFormat;

namespace {

enum Property : guint { prop_buffer_duration = 1, prop_stats };

constexpr GstClockTime default_buffer_duration = 10 * GST_MSECOND;

/// Returned by step() if no output is available.
constexpr GstFlowReturn nothing_ready = GST_FLOW_CUSTOM_SUCCESS;

GstClockTime nanoseconds(Microseconds t) {
  return static_cast<GstClockTime>(std::max<Microseconds>(t, 0)) * GST_USECOND;
}

/// Bounds of a segment in whole microseconds, rounded outwards.
Microseconds position_of(const GstSegment& segment) {
  return static_cast<Microseconds>(segment.position / GST_USECOND);
}
std::optional<Microseconds> stop_of(const GstSegment& segment) {
  if (!GST_CLOCK_TIME_IS_VALID(segment.stop)) return std::nullopt;
  return static_cast<Microseconds>((segment.stop + GST_USECOND - 1) / GST_USECOND);
}

/// A seek that upstream was asked for.
struct Restart {
  GstSegment segment = {};
  std::optional<SeekPoint> seek_point;  ///< unset: the start of the file
  guint32 seqnum = GST_SEQNUM_INVALID;
};

}  // namespace

/// Implementation of the element: connects a RecordingReader to pads, events, queries and messages.
class EventReader {
 public:
  EventReader(GstElement* element, const RecordingFormat& format);
  ~EventReader();
  EventReader(const EventReader&) = delete;
  EventReader& operator=(const EventReader&) = delete;

  void set_buffer_duration(GstClockTime time) { shared_.lock()->buffer_duration = time; }
  GstClockTime buffer_duration() { return shared_.lock()->buffer_duration; }
  GuardedSettings<FormatSettings>& format_settings() { return format_settings_; }
  GstStructure* stats();

  /// Forgets the file.
  void reset();

  gboolean activate(GstPadMode mode, bool active);
  GstFlowReturn chain(GstBuffer* buffer);
  gboolean sink_event(GstEvent* event);
  gboolean src_event(GstPad* pad, GstEvent* event);
  gboolean src_query(GstPad* pad, GstQuery* query);

 private:
  /// State shared between threads; make no calls while holding the lock.
  struct Shared {
    Shared() { gst_segment_init(&segment, GST_FORMAT_TIME); }

    GstClockTime buffer_duration = default_buffer_duration;
    GstSegment segment = {};  ///< relative to the origin; its position is that of the output
    GstClockTime duration = GST_CLOCK_TIME_NONE;
    RecordingReader::Counts counts;
    std::optional<Restart> restart;  ///< push mode: pending seek
    guint64 pushed_bytes = 0;        ///< offset in the file
    guint32 last_seek = GST_SEQNUM_INVALID;
    bool is_pulling = false;
    bool is_timed = false;  ///< times come from upstream
    std::shared_ptr<RecordingReader> recording;
  };

  static void loop(gpointer self);

  template <class Work>
  GstFlowReturn guard(const Work& work);
  Report report_of(const std::exception& error) const;

  void open_recording();
  void close_recording();
  bool carries_words() const;
  bool is_timed() { return shared_.lock()->is_timed; }

  GstFlowReturn pull();
  GstFlowReturn take_buffer(GstBuffer* buffer);
  GstFlowReturn take_interval_end(Microseconds end);
  gboolean take_caps(GstEvent* event);
  gboolean take_segment(GstEvent* event);
  void take_gap(GstEvent* event);
  void take_end();
  GstFlowReturn drain();

  GstFlowReturn step();
  GstFlowReturn hand_out();
  GstFlowReturn push(const RecordingReader::Start& start);
  GstFlowReturn push(const RecordingReader::Chunk& chunk);
  GstFlowReturn push(const RecordingReader::TimedFrame& item);
  GstFlowReturn push(const eventcamera::TriggerItem& item) { return push_to_first(item.triggers); }
  GstFlowReturn push(const eventcamera::ImuItem& item) { return push_to_first(item.samples); }
  template <class Sample>
  GstFlowReturn push_to_first(std::span<const Sample> samples);
  GstFlowReturn combined(ReaderPad& pad, GstFlowReturn result);

  ReaderPad& pad_of(std::size_t stream);
  GstFlowReturn begin_output();
  void start_streams();
  void find_size(std::size_t stream);
  bool send_caps(std::size_t stream);
  GstFlowReturn refused_size(std::size_t stream);
  void send_segment(ReaderPad& pad);
  void interrupt_output();
  void end_output(bool failed);
  gboolean forward(GstEvent* event);
  void push_to_pads(GstEvent* event);

  void note_progress();
  void log_dropped(guint64 outside, guint64 late, guint64 stray, GstClockTime position);
  void set_duration(GstClockTime duration);
  GstClockTime duration();
  void warn_of_dropped();

  bool can_seek();
  bool seek(GstEvent* event);
  bool seek_pulling(const SeekRequest& request);
  bool seek_pushed(const Restart& restart, gdouble rate);

  GstElement* element_;
  GstPad* sink_;
  const RecordingFormat& format_;

  Guarded<Shared> shared_;
  GuardedSettings<FormatSettings> format_settings_;

  // Accessed under the sink pad's stream lock only, or while there is no streaming thread.
  OwnedCaps caps_;                 ///< input caps
  std::optional<PadBytes> bytes_;  ///< pull mode only
  std::shared_ptr<RecordingReader> recording_;
  bool is_consuming_ = false;         ///< bytes were passed to the recording
  GstFlowReturn flow_ = GST_FLOW_OK;  ///< anything else refuses pushed bytes
  guint64 corrupt_places_ = 0;        ///< already signalled by DISCONT and a warning
  WarnOnce warn_of_corruption_{GST_CAT_DEFAULT};
  WarnOnce warn_of_assumption_{GST_CAT_DEFAULT};
  RepeatLevel dropped_level_;

  std::vector<std::unique_ptr<ReaderPad>> pads_;
  std::map<std::size_t, ReaderPad*> pad_of_stream_;
  GstFlowCombiner* combiner_ = gst_flow_combiner_new();
  bool has_no_more_pads_ = false;
  bool output_due_ = true;            ///< caps, segments or held events must be sent before data
  GstEvent* stream_start_ = nullptr;  ///< upstream's
  guint group_ = GST_GROUP_ID_INVALID;
  guint32 seqnum_ = GST_SEQNUM_INVALID;
  std::vector<GstEvent*> held_;  ///< serialized events waiting for caps and segments
};

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

static EventReader& reader_of(gpointer object) {
  return *static_cast<GstEventReader*>(object)->reader;
}

static void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  if (id == prop_buffer_duration)
    reader_of(object).set_buffer_duration(g_value_get_uint64(value));
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
}

static void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  if (id == prop_buffer_duration)
    g_value_set_uint64(value, reader_of(object).buffer_duration());
  else if (id == prop_stats)
    g_value_take_boxed(value, reader_of(object).stats());
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
}

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  const auto result =
      GST_ELEMENT_CLASS(gst_event_reader_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) reader_of(element).reset();
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
  delete &reader_of(object);
  G_OBJECT_CLASS(gst_event_reader_parent_class)->finalize(object);
}

static void gst_event_reader_init(GstEventReader*) {}

static void gst_event_reader_class_init(GstEventReaderClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  object_class->constructed = constructed;
  object_class->finalize = finalize;
  GST_ELEMENT_CLASS(klass)->change_state = change_state;
  g_object_class_install_property(
      object_class, prop_buffer_duration,
      g_param_spec_uint64("buffer-duration", "Buffer duration",
                          "Duration of a buffer of events (nanoseconds, in whole microseconds)",
                          GST_USECOND, 10 * GST_SECOND, default_buffer_duration,
                          static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                                   GST_PARAM_MUTABLE_READY)));
  g_object_class_install_property(
      object_class, prop_stats,
      g_param_spec_boxed("stats", "Statistics",
                         "Counts since the start or the last seek: events, triggers, frames and "
                         "imu-samples read; corrupt-places where bytes were skipped; and what was "
                         "dropped: outside-events, outside the sensor; late-items, after their "
                         "buffer was sent; stray-items, at an impossible time",
                         GST_TYPE_STRUCTURE,
                         static_cast<GParamFlags>(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_READER, static_cast<GstPluginAPIFlags>(0));
}

static void add_template(GstElementClass* klass, const char* name, GstPadDirection direction,
                         GstPadPresence presence, const char* caps) {
  const OwnedCaps owned(gst_caps_from_string(caps));
  gst_element_class_add_pad_template(klass,
                                     gst_pad_template_new(name, direction, presence, owned.get()));
}

static void format_class_init(gpointer klass, gpointer data) {
  const auto& format = *static_cast<const RecordingFormat*>(data);
  static_cast<GstEventReaderClass*>(klass)->format = &format;
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  const char* const name = format.has_many_streams ? "events_%u" : "src";
  add_template(element_class, "sink", GST_PAD_SINK, GST_PAD_ALWAYS, format.caps);
  add_template(element_class, name, GST_PAD_SRC, GST_PAD_SOMETIMES, FILE_EVENTS_CAPS);
  if (format.has_many_streams)
    add_template(element_class, "video_%u", GST_PAD_SRC, GST_PAD_SOMETIMES, RECORDED_VIDEO_CAPS);
  gst_element_class_set_static_metadata(element_class, format.long_name, "Codec/Demuxer",
                                        format.description, EVENTSIM_AUTHORS);
  if (format.add_properties != nullptr) {
    FormatProperties properties(G_OBJECT_CLASS(klass));
    format.add_properties(properties);
  }
}

GuardedSettings<FormatSettings>& format_settings_of(GObject* reader) {
  return reader_of(reader).format_settings();
}

GType event_reader_type(const RecordingFormat& format) {
  const GType known = g_type_from_name(format.type_name);
  if (known != G_TYPE_INVALID) return known;
  GTypeInfo info = {};
  info.class_size = sizeof(GstEventReaderClass);
  info.class_init = format_class_init;
  info.class_data = &format;
  info.instance_size = sizeof(GstEventReader);
  return g_type_register_static(GST_TYPE_EVENT_READER, format.type_name, &info,
                                static_cast<GTypeFlags>(0));
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
        return reader_of(parent).activate(mode, active != FALSE);
      });
  gst_pad_set_chain_function(
      sink_, +[](GstPad*, GstObject* parent, GstBuffer* buffer) {
        return reader_of(parent).chain(buffer);
      });
  gst_pad_set_event_function(
      sink_, +[](GstPad*, GstObject* parent, GstEvent* event) {
        return reader_of(parent).sink_event(event);
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

/// decodebin drops errors of an element that it is still adding, which it shows by a locked state,
/// and then waits for the element's pads for ever. An application may lock the state for longer.
static void wait_until_added(GstElement* element) {
  constexpr int max_milliseconds = 1000;
  for (int i = 0; i < max_milliseconds && gst_element_is_locked_state(element); ++i) g_usleep(1000);
}

/// Runs `work`; reports any exception. If the cause is a failed pull, returns its flow instead.
template <class Work>
GstFlowReturn EventReader::guard(const Work& work) {
  return guarded(
      element_, [this](const std::exception& error) { return report_of(error); },
      [&]() -> GstFlowReturn {
        try {
          return work();
        } catch (const std::exception&) {
          wait_until_added(element_);
          if (!bytes_ || !bytes_->failed()) throw;
          return bytes_->flow();
        }
      });
}

/* pull mode */

gboolean EventReader::activate(GstPadMode mode, bool active) {
  shared_.lock()->is_pulling = mode == GST_PAD_MODE_PULL && active;
  if (mode != GST_PAD_MODE_PULL) return TRUE;
  return active ? gst_pad_start_task(sink_, loop, this, nullptr) : gst_pad_stop_task(sink_);
}

/// Within decodebin, eventrender took the events, and the application wanted something else.
static Report not_linked() {
  return {GST_STREAM_ERROR_FAILED,
          "No element takes what is read. decodebin draws events as video; for the events "
          "themselves, set decodebin " ASK_FOR_EVENTS "."};
}

void EventReader::loop(gpointer data) {
  auto& self = *static_cast<EventReader*>(data);
  const GstFlowReturn result = self.guard([&] { return self.pull(); });
  if (result == GST_FLOW_OK) return;
  GST_DEBUG_OBJECT(self.element_, "pausing: %s", gst_flow_get_name(result));
  gst_pad_pause_task(self.sink_);
  if (result == GST_FLOW_FLUSHING) return;
  auto* const element = self.element_;
  if (result != GST_FLOW_EOS) wait_until_added(element);
  if (result == GST_FLOW_NOT_LINKED)
    post_message(element, GST_MESSAGE_ERROR, not_linked(), "streaming stopped, reason not-linked");
  else if (result != GST_FLOW_EOS && result != GST_FLOW_ERROR)
    GST_ELEMENT_FLOW_ERROR(element, result);
  self.end_output(result != GST_FLOW_EOS);
}

/// Pushes the next output. Returns GST_FLOW_EOS at the end of the file or of the segment.
GstFlowReturn EventReader::pull() {
  if (!recording_) {
    OwnedCaps caps(gst_pad_peer_query_caps(sink_, nullptr));
    if (gst_caps_is_fixed(caps.get())) caps_ = std::move(caps);
    bytes_.emplace(sink_);
    open_recording();
    const auto segment = shared_.lock()->segment;
    recording_->seek(position_of(segment), stop_of(segment));
  }
  bytes_->retry();
  GstFlowReturn result = step();
  if (result != nothing_ready) return result;
  result = output_due_ ? begin_output() : GST_FLOW_OK;
  if (recording_->at_end()) {
    warn_of_dropped();
    if (const auto length = recording_->duration()) set_duration(nanoseconds(*length));
  }
  return result == GST_FLOW_OK ? GST_FLOW_EOS : result;
}

/* push mode */

GstFlowReturn EventReader::chain(GstBuffer* buffer) {
  const OwnedBuffer owner(buffer);
  if (is_timed() && GST_BUFFER_IS_DISCONT(buffer)) {
    const GstFlowReturn drained = drain();
    if (drained != GST_FLOW_OK) return drained;
    for (auto& pad : pads_) pad->interrupt();
    for (auto& pad : pads_) pad->need_segment(false);
  }
  if (flow_ != GST_FLOW_OK) return flow_;
  flow_ = guard([&] { return take_buffer(buffer); });
  if (flow_ == GST_FLOW_NOT_LINKED)  // upstream may have others to feed
    post_message(element_, GST_MESSAGE_WARNING, not_linked(), "all source pads are not linked");
  return flow_;
}

/// May throw.
GstFlowReturn EventReader::take_buffer(GstBuffer* buffer) {
  const MappedBytes bytes(element_, OwnedBuffer(gst_buffer_ref(buffer)));
  if (!bytes.is_mapped()) return GST_FLOW_ERROR;
  if (!recording_) open_recording();
  is_consuming_ = true;
  std::optional<RecordingReader::Interval> interval;
  const bool has_end = GST_BUFFER_DURATION_IS_VALID(buffer);
  if (is_timed() && GST_BUFFER_PTS_IS_VALID(buffer))
    interval = {static_cast<Microseconds>(GST_BUFFER_PTS(buffer) / GST_USECOND),
                has_end ? static_cast<Microseconds>(GST_BUFFER_DURATION(buffer) / GST_USECOND) : 0};
  recording_->push(bytes.get(), interval);
  GstFlowReturn result = hand_out();
  if (result == GST_FLOW_OK && interval && has_end)
    result = take_interval_end(static_cast<Microseconds>(
        (GST_BUFFER_PTS(buffer) + GST_BUFFER_DURATION(buffer)) / GST_USECOND));
  if (result != GST_FLOW_OK) {
    try {
      recording_->discard();
    } catch (const std::exception& error) {
      GST_DEBUG_OBJECT(element_, "dropped bytes cannot be read: %s", error.what());
    }
  }
  shared_.lock()->pushed_bytes += bytes.get().size();
  return result;
}

/// Handles the end of an upstream interval: nothing earlier will follow. May throw.
GstFlowReturn EventReader::take_interval_end(Microseconds end) {
  recording_->reach(end);
  return hand_out();
}

/// Pushes all available output. May throw.
GstFlowReturn EventReader::hand_out() {
  GstFlowReturn result = GST_FLOW_OK;
  while (result == GST_FLOW_OK) result = step();
  if (result != nothing_ready) return result;
  return recording_->is_past_stop() ? GST_FLOW_EOS : GST_FLOW_OK;
}

gboolean EventReader::sink_event(GstEvent* event) {
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_STREAM_START:
      drain();  // into the stream that ends here, before the new one
      gst_event_replace(&stream_start_, event);
      gst_event_unref(event);
      for (auto& pad : pads_) pad->reset();
      group_ = GST_GROUP_ID_INVALID;
      output_due_ = true;
      return TRUE;
    case GST_EVENT_CAPS:
      return take_caps(event);
    case GST_EVENT_SEGMENT:
      return take_segment(event);
    case GST_EVENT_GAP:
      take_gap(event);
      return TRUE;
    case GST_EVENT_EOS:
      seqnum_ = gst_event_get_seqnum(event);
      gst_event_unref(event);
      take_end();
      is_consuming_ = false;
      end_output(flow_ != GST_FLOW_OK && flow_ != GST_FLOW_EOS);
      return TRUE;
    case GST_EVENT_FLUSH_STOP:
      for (GstEvent* held : std::exchange(held_, {})) gst_event_unref(held);
      if (recording_ && is_timed()) recording_->interrupt();
      is_consuming_ = false;
      flow_ = GST_FLOW_OK;
      gst_flow_combiner_reset(combiner_);
      interrupt_output();
      return gst_pad_event_default(sink_, GST_OBJECT(element_), event);
    default:
      return (gst_event_type_get_flags(GST_EVENT_TYPE(event)) & GST_EVENT_TYPE_SERIALIZED)
                 ? forward(event)
                 : gst_pad_event_default(sink_, GST_OBJECT(element_), event);
  }
}

/// Forwards an event in order. Takes ownership of `event`.
gboolean EventReader::forward(GstEvent* event) {
  if (output_due_)
    held_.push_back(event);
  else
    push_to_pads(event);
  return TRUE;
}

/// Pushes all pending output before a discontinuity.
GstFlowReturn EventReader::drain() {
  if (is_consuming_) take_end();
  if (recording_) recording_->interrupt();
  is_consuming_ = false;
  return std::exchange(flow_, GST_FLOW_OK);
}

void EventReader::take_end() {
  if (flow_ != GST_FLOW_OK) return;
  flow_ = guard([&] {
    if (!recording_) open_recording();
    recording_->finish();
    GstFlowReturn result = hand_out();
    if (result == GST_FLOW_OK && output_due_) result = begin_output();
    warn_of_dropped();
    return result;
  });
}

gboolean EventReader::take_caps(GstEvent* event) {
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  const bool is_new = !caps_ || !gst_caps_is_equal(caps_.get(), caps);
  if (is_new) {
    drain();
    close_recording();
    caps_.reset(gst_caps_ref(caps));
  }
  gst_event_unref(event);
  return TRUE;
}

/// True for words without a header; files have their own times, whatever their segment.
bool EventReader::carries_words() const {
  return caps_ && gst_structure_has_name(gst_caps_get_structure(caps_.get(), 0),
                                         GST_EVENT_CAMERA_MEDIA_TYPE);
}

/// Takes ownership of `event`.
gboolean EventReader::take_segment(GstEvent* event) {
  const GstSegment* segment = nullptr;
  gst_event_parse_segment(event, &segment);
  drain();
  const bool timed = segment->format == GST_FORMAT_TIME && carries_words();
  const guint64 start = segment->start;
  bool was_timed = false;
  std::optional<Restart> restart;
  {
    const auto shared = shared_.lock();
    was_timed = std::exchange(shared->is_timed, timed);
    shared->pushed_bytes = segment->format == GST_FORMAT_BYTES ? start : 0;
    restart = shared->restart;
  }
  if (timed) {
    if (!was_timed) close_recording();
    for (auto& pad : pads_) pad->need_segment(false);
    return forward(event);
  }
  const guint32 seqnum = gst_event_get_seqnum(event);
  gst_event_unref(event);
  const bool is_sought = restart && restart->seek_point.value_or(SeekPoint{}).position == start;
  if (restart && !is_sought && seqnum != restart->seqnum) {
    // The segment belongs to an earlier seek; the pending one will flush what follows.
    flow_ = GST_FLOW_FLUSHING;
    return TRUE;
  }
  shared_.lock()->restart.reset();
  interrupt_output();
  // A seek point is useless for a recording that was closed meanwhile.
  if (!is_sought || (restart->seek_point && !recording_)) {
    close_recording();  // another file
    seqnum_ = seqnum;
    const auto shared = shared_.lock();
    shared->duration = GST_CLOCK_TIME_NONE;
    gst_segment_init(&shared->segment, GST_FORMAT_TIME);
    return TRUE;
  }
  {
    const auto shared = shared_.lock();
    shared->segment = restart->segment;
    shared->counts = {};
  }
  seqnum_ = restart->seqnum;
  corrupt_places_ = 0;
  return guard([&] {
           if (!recording_) open_recording();
           recording_->restart(restart->seek_point, position_of(restart->segment),
                               stop_of(restart->segment));
           return GST_FLOW_OK;
         }) == GST_FLOW_OK;
}

/// Takes ownership of `event`.
void EventReader::take_gap(GstEvent* event) {
  GstClockTime pts = GST_CLOCK_TIME_NONE;
  GstClockTime duration = GST_CLOCK_TIME_NONE;
  gst_event_parse_gap(event, &pts, &duration);
  const bool is_known = GST_CLOCK_TIME_IS_VALID(duration) && is_timed() && flow_ == GST_FLOW_OK;
  if (is_known)
    flow_ = guard([&] {
      if (!recording_) open_recording();
      if (recording_->reach(static_cast<Microseconds>((pts + duration) / GST_USECOND)))
        return hand_out();
      GstFlowReturn result = hand_out();
      if (result == GST_FLOW_OK && output_due_) result = begin_output();
      if (result == GST_FLOW_OK) push_to_pads(gst_event_ref(event));
      return result;
    });
  gst_event_unref(event);
}

/* output */

/// Reads and pushes one item. May throw.
GstFlowReturn EventReader::step() {
  const auto output = recording_->next();
  if (bytes_ && bytes_->failed()) return bytes_->flow();
  note_progress();
  if (!output) return nothing_ready;
  return std::visit([this](const auto& item) { return push(item); }, *output);
}

/// New streams are known.
GstFlowReturn EventReader::push(const RecordingReader::Start& /*start*/) {
  if (const auto length = recording_->duration()) set_duration(nanoseconds(*length));
  GST_DEBUG_OBJECT(element_,
                   "%" G_GSIZE_FORMAT " streams, origin %" GST_TIME_FORMAT
                   ", duration %" GST_TIME_FORMAT,
                   recording_->streams().size(), GST_TIME_ARGS(nanoseconds(recording_->origin())),
                   GST_TIME_ARGS(duration()));
  return begin_output();
}

GstFlowReturn EventReader::push(const RecordingReader::Chunk& chunk) {
  if (output_due_)
    if (const GstFlowReturn begun = begin_output(); begun != GST_FLOW_OK) return begun;
  auto& pad = *pad_of_stream_.at(chunk.stream);
  if (!send_caps(chunk.stream)) return refused_size(chunk.stream);
  const GstClockTime pts = nanoseconds(recording_->origin()) + nanoseconds(chunk.start);
  const GstClockTime duration = nanoseconds(chunk.duration);
  GST_LOG_OBJECT(pad.get(),
                 "%" G_GSIZE_FORMAT " events at %" GST_TIME_FORMAT " for %" GST_TIME_FORMAT,
                 chunk.events.size(), GST_TIME_ARGS(pts), GST_TIME_ARGS(duration));
  if (chunk.events.empty()) return combined(pad, pad.push_gap(pts, duration));
  return combined(pad, pad.push(chunk.events, pts, duration));
}

GstFlowReturn EventReader::push(const RecordingReader::TimedFrame& item) {
  if (output_due_)
    if (const GstFlowReturn begun = begin_output(); begun != GST_FLOW_OK) return begun;
  auto& pad = *pad_of_stream_.at(item.stream);
  GstVideoInfo info;
  if (!frame_video_info(item.frame, &info)) return GST_FLOW_OK;
  if (!pad.send_caps(info) && GST_PAD_IS_FLUSHING(pad.get())) return GST_FLOW_FLUSHING;
  const GstClockTime pts = nanoseconds(recording_->origin()) + nanoseconds(item.time);
  GST_LOG_OBJECT(pad.get(), "frame at %" GST_TIME_FORMAT, GST_TIME_ARGS(pts));
  return combined(pad, pad.push(frame_buffer(item.frame, &info), pts));
}

/// Sends triggers or IMU samples with the first stream of events, if there is one.
template <class Sample>
GstFlowReturn EventReader::push_to_first(std::span<const Sample> samples) {
  if (output_due_)
    if (const GstFlowReturn begun = begin_output(); begun != GST_FLOW_OK) return begun;
  std::vector<Sample> of_stream(samples.begin(), samples.end());
  for (auto& sample : of_stream) sample.t += std::max<Microseconds>(recording_->origin(), 0);
  const auto& streams = recording_->streams();
  const auto first = std::ranges::find_if(streams, [](const RecordingReader::Stream& stream) {
    return stream.shown && stream.info.kind == StreamKind::events;
  });
  if (first == streams.end()) return GST_FLOW_OK;
  auto& pad = pad_of(static_cast<std::size_t>(first - streams.begin()));
  gst_pad_push_event(pad.get(), new_sensor_event(std::span<const Sample>(of_stream)));
  return GST_FLOW_OK;
}

GstFlowReturn EventReader::combined(ReaderPad& pad, GstFlowReturn result) {
  return gst_flow_combiner_update_pad_flow(combiner_, pad.get(), result);
}

ReaderPad& EventReader::pad_of(std::size_t index) {
  auto& found = pad_of_stream_[index];
  if (found != nullptr) return *found;
  const auto& stream = recording_->streams()[index];
  const char* const kind = stream.info.kind == StreamKind::frames ? "video_" : "events_";
  const auto name = format_.has_many_streams ? kind + std::to_string(stream.number) : "src";
  for (auto& pad : pads_)
    if (pad->name() == name) return *(found = pad.get());
  auto* const templ = gst_element_class_get_pad_template(
      GST_ELEMENT_GET_CLASS(element_),
      format_.has_many_streams ? (kind + std::string("%u")).c_str() : "src");
  found = pads_.emplace_back(std::make_unique<ReaderPad>(templ, name, GST_CAT_DEFAULT)).get();
  gst_pad_set_event_function(
      found->get(), +[](GstPad* pad, GstObject* parent, GstEvent* event) {
        return reader_of(parent).src_event(pad, event);
      });
  gst_pad_set_query_function(
      found->get(), +[](GstPad* pad, GstObject* parent, GstQuery* query) {
        return reader_of(parent).src_query(pad, query);
      });
  return *found;
}

/// Sends all events that must precede data.
GstFlowReturn EventReader::begin_output() {
  output_due_ = false;
  start_streams();
  const auto& streams = recording_->streams();
  for (std::size_t i = 0; i < streams.size(); ++i) {
    if (!streams[i].shown) continue;
    find_size(i);
    if (!send_caps(i)) {
      output_due_ = true;
      return pad_of(i).refusal();
    }
    send_segment(pad_of(i));
  }
  for (GstEvent* event : std::exchange(held_, {})) push_to_pads(event);
  // Writers must know these streams before the first buffer.
  if (format_.has_triggers) push(eventcamera::TriggerItem{});
  if (std::ranges::any_of(streams,
                          [](const auto& stream) { return stream.info.kind == StreamKind::imu; }))
    push(eventcamera::ImuItem{});
  return GST_FLOW_OK;
}

/// Starts streams and adds their pads. With many streams, pads have caps before they are added,
/// except where the linked element may determine the sensor size, as with a single pad.
void EventReader::start_streams() {
  const auto& streams = recording_->streams();
  const bool is_upstreams = is_timed() && stream_start_ != nullptr;
  bool is_any_new = false;
  for (std::size_t i = 0; i < streams.size(); ++i) {
    if (!streams[i].shown) continue;
    auto& pad = pad_of(i);
    if (pad.is_started()) continue;
    is_any_new = true;
    if (group_ == GST_GROUP_ID_INVALID) {
      GstEvent* const sticky = gst_pad_get_sticky_event(sink_, GST_EVENT_STREAM_START, 0);
      if (sticky == nullptr || !gst_event_parse_group_id(sticky, &group_))
        group_ = gst_util_group_id_next();
      if (sticky != nullptr) gst_event_unref(sticky);
    }
    if (is_upstreams)
      pad.start_stream(gst_event_ref(stream_start_));
    else
      pad.start_stream(element_, group_);
    if (is_timed()) pad.need_segment(false);
    if (!format_.has_many_streams) continue;
    if (streams[i].size_from == RecordingReader::SizeFrom::file) {
      send_caps(i);
      send_segment(pad);
    }
    pad.send_tags(recording_->format_name(), streams[i].info.source);
  }
  if (!is_any_new) return;
  if (!is_upstreams) {
    GstStreamCollection* const collection = gst_stream_collection_new(nullptr);
    for (auto& pad : pads_)
      if (GstStream* const stream = gst_pad_get_stream(pad->get()))
        gst_stream_collection_add_stream(collection, stream);
    gst_element_post_message(element_,
                             gst_message_new_stream_collection(GST_OBJECT(element_), collection));
    for (auto& pad : pads_)
      gst_pad_push_event(pad->get(), gst_event_new_stream_collection(collection));
    gst_object_unref(collection);
  }
  for (auto& pad : pads_) {
    if (pad->is_added()) continue;
    gst_flow_combiner_add_pad(combiner_, pad->get());
    gst_element_add_pad(element_, pad->get());
  }
  if (!std::exchange(has_no_more_pads_, true)) gst_element_no_more_pads(element_);
}

/// If the file does not state the sensor size, uses that of the properties, else the size in
/// downstream's caps, else one that all events fit into.
void EventReader::find_size(std::size_t index) {
  const auto& stream = recording_->streams()[index];
  if (stream.size_from != RecordingReader::SizeFrom::assumption) return;
  if (const auto size = format_settings_.copy().sensor; size.width > 0 && size.height > 0) {
    recording_->set_size(index, size);
    return;
  }
  GstPad* const pad = pad_of(index).get();
  const OwnedCaps templ(gst_pad_get_pad_template_caps(pad));
  const OwnedCaps peer(gst_pad_peer_query_caps(pad, templ.get()));
  eventcamera::SensorSize size;
  if (!gst_caps_is_empty(peer.get())) {
    const auto* const structure = gst_caps_get_structure(peer.get(), 0);
    if (gst_structure_get_int(structure, "width", &size.width) &&
        gst_structure_get_int(structure, "height", &size.height)) {
      recording_->set_size(index, size);
      return;
    }
  }
  const auto text =
      std::to_string(stream.info.size.width) + "x" + std::to_string(stream.info.size.height);
  GST_INFO_OBJECT(element_, "the file does not state the sensor size; assuming %s", text.c_str());
  if (stream.info.mirrored)
    warn_of_assumption_(element_,
                        {GST_STREAM_ERROR_FORMAT,
                         "The file does not state its sensor size; assuming " + text +
                             " pixels. If events are in the wrong place, set width and height."},
                        "columns and rows of the file count from the far corner");
}

bool EventReader::send_caps(std::size_t index) {
  const auto& stream = recording_->streams()[index];
  auto& pad = pad_of(index);
  if (stream.info.kind == StreamKind::events) {
    const bool taken = pad.send_caps(stream.info.size);
    if (!taken)
      GST_DEBUG_OBJECT(pad.get(), "a sensor of %dx%d pixels is refused", stream.info.size.width,
                       stream.info.size.height);
    return taken;
  }
  GstVideoInfo info;
  return pad.has_video() || !frame_video_info(*stream.first_frame, &info) || pad.send_caps(info);
}

/// Handles downstream's refusal of a sensor size that has grown.
GstFlowReturn EventReader::refused_size(std::size_t index) {
  const GstFlowReturn refusal = pad_of(index).refusal();
  if (refusal == GST_FLOW_FLUSHING) return refusal;
  const auto size = recording_->streams()[index].info.size;
  const auto text = std::to_string(size.width) + "x" + std::to_string(size.height);
  post_message(element_, GST_MESSAGE_ERROR,
               {GST_STREAM_ERROR_FORMAT,
                "Events lie outside the assumed sensor, whose size the file does not state. Set "
                "width and height; the events so far need " +
                    text + " pixels."},
               "downstream refuses to change the size to " + text);
  return GST_FLOW_ERROR;
}

void EventReader::send_segment(ReaderPad& pad) {
  GstSegment segment;
  {
    const auto shared = shared_.lock();
    shared->segment.duration = shared->duration;
    segment = shared->segment;
  }
  const GstClockTime origin = nanoseconds(recording_->origin());
  segment.start += origin;
  segment.position += origin;
  if (GST_CLOCK_TIME_IS_VALID(segment.stop)) segment.stop += origin;
  pad.send_segment(segment, seqnum_);
}

/// Marks the next output as discontinuous.
void EventReader::interrupt_output() {
  for (auto& pad : pads_) pad->interrupt();
  output_due_ = true;
}

/// Ends the streams with EOS, or the segment with SEGMENT_DONE if a segment seek was requested.
void EventReader::end_output(bool failed) {
  const auto segment = shared_.lock()->segment;
  if (failed || (segment.flags & GST_SEGMENT_FLAG_SEGMENT) == 0) {
    push_to_pads(with_seqnum(gst_event_new_eos(), seqnum_));
    return;
  }
  const auto position =
      static_cast<gint64>(GST_CLOCK_TIME_IS_VALID(segment.stop) ? segment.stop : segment.position);
  GstMessage* const message =
      gst_message_new_segment_done(GST_OBJECT(element_), GST_FORMAT_TIME, position);
  if (seqnum_ != GST_SEQNUM_INVALID) gst_message_set_seqnum(message, seqnum_);
  gst_element_post_message(element_, message);
  push_to_pads(with_seqnum(gst_event_new_segment_done(GST_FORMAT_TIME, position), seqnum_));
}

/// Takes ownership of `event`.
void EventReader::push_to_pads(GstEvent* event) {
  for (auto& pad : pads_) gst_pad_push_event(pad->get(), gst_event_ref(event));
  gst_event_unref(event);
}

/* progress, statistics and warnings */

void EventReader::log_dropped(guint64 outside, guint64 late, guint64 stray, GstClockTime position) {
  if (outside + late + stray == 0) return;
  const auto level = dropped_level_.next();
  GST_CAT_LEVEL_LOG(GST_CAT_DEFAULT, level, element_,
                    "dropped %" G_GUINT64_FORMAT " events outside the sensor, %" G_GUINT64_FORMAT
                    " late items and %" G_GUINT64_FORMAT
                    " at impossible times, before %" GST_TIME_FORMAT,
                    outside, late, stray, GST_TIME_ARGS(position));
}

/// Updates position and counts, and reports new corruption.
void EventReader::note_progress() {
  const auto counts = recording_->counts();
  const auto position = nanoseconds(recording_->position());
  auto before = counts;
  {
    const auto shared = shared_.lock();
    std::swap(shared->counts, before);
    if (!shared->is_timed) shared->segment.position = std::max(shared->segment.position, position);
  }
  log_dropped(counts.outside - before.outside, counts.late - before.late,
              counts.stray - before.stray, position);
  if (counts.corrupt_places > corrupt_places_)
    for (auto& pad : pads_) pad->interrupt_data();
  if (counts.corrupt_places > 0 && counts.corrupt_places != corrupt_places_) {
    const auto& corruption = recording_->corruption();
    const auto at = std::to_string(corruption.first_at);
    warn_of_corruption_(
        element_,
        {format_.has_many_streams ? GST_STREAM_ERROR_DEMUX : GST_STREAM_ERROR_DECODE,
         "Corrupt data at byte " + at + ": " + corruption.first +
             "; skipping it. The stats property counts what is dropped."},
        std::to_string(counts.corrupt_places) + " corrupt places, the last at byte " +
            std::to_string(corruption.last_at));
  }
  corrupt_places_ = counts.corrupt_places;
}

GstStructure* EventReader::stats() {
  const auto counts = shared_.lock()->counts;
  GstStructure* const stats = gst_structure_new(
      format_.has_many_streams ? "application/x-aedat-demux-stats"
                               : "application/x-event-decoder-stats",
      "events", G_TYPE_UINT64, counts.events, "triggers", G_TYPE_UINT64, counts.triggers,
      "corrupt-places", G_TYPE_UINT64, counts.corrupt_places, "outside-events", G_TYPE_UINT64,
      counts.outside, "late-items", G_TYPE_UINT64, counts.late, "stray-items", G_TYPE_UINT64,
      counts.stray, nullptr);
  if (format_.has_many_streams)
    gst_structure_set(stats, "frames", G_TYPE_UINT64, counts.frames, "imu-samples", G_TYPE_UINT64,
                      counts.imu_samples, nullptr);
  return stats;
}

/// Posts a warning at the end about dropped items.
void EventReader::warn_of_dropped() {
  const auto counts = recording_->counts();
  const auto text_of = [](guint64 number) { return std::to_string(number); };
  const auto untimely = counts.late + counts.stray;
  GST_INFO_OBJECT(element_, "%" G_GUINT64_FORMAT " corrupt places, %" G_GUINT64_FORMAT " triggers",
                  guint64{counts.corrupt_places}, guint64{counts.triggers});
  if (untimely + counts.outside == 0) return;
  post_message(element_, GST_MESSAGE_WARNING,
               {format_.has_many_streams ? GST_STREAM_ERROR_DEMUX : GST_STREAM_ERROR_DECODE,
                text_of(counts.outside) + " events outside the sensor, and " + text_of(untimely) +
                    " items with times out of order, were dropped."},
               text_of(counts.late) + " late, " + text_of(counts.stray) + " at stray times");
}

void EventReader::set_duration(GstClockTime duration) {
  if (std::exchange(shared_.lock()->duration, duration) != duration)
    gst_element_post_message(element_, gst_message_new_duration_changed(GST_OBJECT(element_)));
}

/// In push mode the duration is extrapolated from the bytes received so far.
GstClockTime EventReader::duration() {
  guint64 pushed = 0;
  GstClockTime position = 0;
  {
    const auto shared = shared_.lock();
    if (GST_CLOCK_TIME_IS_VALID(shared->duration) || shared->is_pulling) return shared->duration;
    pushed = shared->pushed_bytes;
    position = shared->segment.position;
  }
  const guint64 size = upstream_bytes(sink_);
  if (size == 0 || pushed == 0 || position == 0) return GST_CLOCK_TIME_NONE;
  return gst_util_uint64_scale(position, size, pushed);
}

gboolean EventReader::src_query(GstPad* pad, GstQuery* query) {
  GstFormat format = GST_FORMAT_UNDEFINED;
  if (GST_QUERY_TYPE(query) == GST_QUERY_LATENCY)
    return answer_latency(GST_CAT_DEFAULT, sink_, query, buffer_duration()) ||
           gst_pad_query_default(pad, GST_OBJECT(element_), query);
  if (is_timed()) return gst_pad_query_default(pad, GST_OBJECT(element_), query);
  switch (GST_QUERY_TYPE(query)) {
    case GST_QUERY_POSITION: {
      gst_query_parse_position(query, &format, nullptr);
      if (format != GST_FORMAT_TIME) return FALSE;
      const auto position = shared_.lock()->segment.position;
      gst_query_set_position(query, format, static_cast<gint64>(position));
      return TRUE;
    }
    case GST_QUERY_DURATION: {
      gst_query_parse_duration(query, &format, nullptr);
      if (format != GST_FORMAT_TIME) return FALSE;
      const GstClockTime length = duration();
      if (!GST_CLOCK_TIME_IS_VALID(length)) return FALSE;
      gst_query_set_duration(query, format, static_cast<gint64>(length));
      return TRUE;
    }
    case GST_QUERY_SEEKING:
      gst_query_parse_seeking(query, &format, nullptr, nullptr, nullptr);
      if (format != GST_FORMAT_TIME) return FALSE;
      gst_query_set_seeking(query, format, can_seek(), 0, static_cast<gint64>(duration()));
      return TRUE;
    case GST_QUERY_SEGMENT: {
      const auto segment = shared_.lock()->segment;
      const auto stop = GST_CLOCK_TIME_IS_VALID(segment.stop) ? segment.stop : duration();
      gst_query_set_segment(query, segment.rate, GST_FORMAT_TIME,
                            static_cast<gint64>(segment.start), static_cast<gint64>(stop));
      return TRUE;
    }
    default:
      break;
  }
  return gst_pad_query_default(pad, GST_OBJECT(element_), query);
}

/* seeking */

gboolean EventReader::src_event(GstPad* pad, GstEvent* event) {
  if (GST_EVENT_TYPE(event) != GST_EVENT_SEEK || is_timed())
    return gst_pad_event_default(pad, GST_OBJECT(element_), event);
  const bool done = seek(event);
  gst_event_unref(event);
  return done;
}

bool EventReader::can_seek() {
  if (shared_.lock()->is_pulling) return true;
  GstQuery* const query = gst_query_new_seeking(GST_FORMAT_BYTES);
  gboolean seekable = FALSE;
  if (gst_pad_peer_query(sink_, query))
    gst_query_parse_seeking(query, nullptr, &seekable, nullptr, nullptr);
  gst_query_unref(query);
  return seekable != FALSE;
}

bool EventReader::seek(GstEvent* event) {
  const SeekRequest request(event);
  if (!request.plays_on_from_time() || !can_seek()) {
    GST_INFO_OBJECT(element_, "refused to seek at rate %g in %s", request.rate(),
                    gst_format_get_name(request.format()));
    return false;
  }
  Restart restart;
  bool is_pulling = false;
  std::shared_ptr<RecordingReader> recording;
  {
    const auto shared = shared_.lock();
    // A bin sends a seek to each of its sinks, so the same seek may arrive on every source pad.
    if (shared->last_seek == request.seqnum()) return true;
    is_pulling = shared->is_pulling;
    recording = shared->recording;
    restart.segment = shared->segment;
    restart.segment.duration = shared->duration;
  }
  if (!request.apply(restart.segment)) return false;
  restart.seqnum = request.seqnum();
  if (!is_pulling && !request.flushes()) return false;
  if (!is_pulling && recording)
    restart.seek_point = recording->seek_point_before(position_of(restart.segment));
  GST_DEBUG_OBJECT(element_,
                   "seek in %s mode to %" GST_TIME_FORMAT ", from byte %" G_GUINT64_FORMAT
                   " on: %" GST_SEGMENT_FORMAT,
                   is_pulling ? "pull" : "push", GST_TIME_ARGS(restart.segment.position),
                   guint64{restart.seek_point.value_or(SeekPoint{}).position}, &restart.segment);
  const bool done = is_pulling ? seek_pulling(request) : seek_pushed(restart, request.rate());
  if (done) shared_.lock()->last_seek = request.seqnum();
  return done;
}

bool EventReader::seek_pulling(const SeekRequest& request) {
  // The streaming thread may add pads concurrently, so iterate safely.
  const auto send_all = [&](GstEvent* event) {
    gst_event_set_seqnum(event, request.seqnum());
    gst_pad_push_event(sink_, gst_event_ref(event));
    gst_element_foreach_src_pad(
        element_,
        +[](GstElement*, GstPad* pad, gpointer sent) -> gboolean {
          gst_pad_push_event(pad, gst_event_ref(static_cast<GstEvent*>(sent)));
          return TRUE;
        },
        event);
    gst_event_unref(event);
  };
  if (request.flushes())
    send_all(gst_event_new_flush_start());
  else
    gst_pad_pause_task(sink_);
  GST_PAD_STREAM_LOCK(sink_);
  if (request.flushes()) send_all(gst_event_new_flush_stop(TRUE));
  GstSegment segment;
  {
    const auto shared = shared_.lock();
    shared->segment.duration = shared->duration;
    request.apply(shared->segment);  // from the position at which output has stopped
    shared->counts = {};
    segment = shared->segment;
  }
  seqnum_ = request.seqnum();
  corrupt_places_ = 0;
  gst_flow_combiner_reset(combiner_);
  interrupt_output();
  const GstFlowReturn result = guard([&] {
    if (bytes_) bytes_->retry();
    if (recording_) recording_->seek(position_of(segment), stop_of(segment));
    return GST_FLOW_OK;
  });
  if (shared_.lock()->is_pulling) gst_pad_start_task(sink_, loop, this, nullptr);
  GST_PAD_STREAM_UNLOCK(sink_);
  return result == GST_FLOW_OK;
}

/// Forwards a seek as a seek in bytes. Upstream flushes and sends a BYTES segment, which completes
/// the seek.
bool EventReader::seek_pushed(const Restart& restart, gdouble rate) {
  GstEvent* const event = with_seqnum(
      gst_event_new_seek(rate, GST_FORMAT_BYTES, GST_SEEK_FLAG_FLUSH, GST_SEEK_TYPE_SET,
                         static_cast<gint64>(restart.seek_point.value_or(SeekPoint{}).position),
                         GST_SEEK_TYPE_NONE, -1),
      restart.seqnum);
  shared_.lock()->restart = restart;
  if (gst_pad_push_event(sink_, event)) return true;
  shared_.lock()->restart.reset();
  return false;
}
