// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/recording/eventwriter.hpp"

#include "gst/base/buffer_bytes.hpp"
#include "gst/base/element_type.hpp"
#include "gst/base/pads.hpp"
#include "gst/base/properties.hpp"
#include "gst/recording/file_extensions.hpp"
#include "gst/recording/sensor_events.hpp"
#include "gst/recording/writable_events.hpp"
#include "src/core/event.hpp"
#include "src/formats/waiting_items.hpp"

GST_DEBUG_CATEGORY(event_writer_debug);
#define GST_CAT_DEFAULT event_writer_debug

using namespace eventcamera;

namespace {

/// Alignment of words in bytes; none crosses a multiple of it.
constexpr std::size_t word_bytes = 8;

/// Maximum bytes per event, including time words.
constexpr std::size_t max_event_bytes = 32;

std::size_t capacity(guint mtu) {
  return mtu / word_bytes * word_bytes;
}

/// A stream without buffers may have no segment.
void ensure_segment(GstPad* src) {
  if (const OwnedEvent sent(gst_pad_get_sticky_event(src, GST_EVENT_SEGMENT, 0)); sent) return;
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_TIME);
  gst_pad_push_event(src, gst_event_new_segment(&segment));
}

/// Returns the number of leading events that fit into `room` bytes. Limited to events so close in
/// time that no words for pauses are written between them.
std::size_t count_that_fits(std::span<const AbsoluteEvent> events, std::size_t room) {
  constexpr Microseconds close = 1000;
  events = events.first(std::min(events.size(), room / max_event_bytes));
  const auto end = std::ranges::find_if(
      events, [&](const auto& event) { return event.t - events.front().t > close; });
  return static_cast<std::size_t>(end - events.begin());
}

/// A file that an element writes: encodes events and triggers, and pushes the bytes. All functions
/// but the accessors may throw.
class WrittenFile {
 public:
  /// Begins a file of a sensor, with these output caps, to which the header is added.
  WrittenFile(WritableEvents& writable, GstPad* src, const GstEventCameraInfo& info,
              std::unique_ptr<Encoder> encoder, OwnedCaps caps)
      : writable_(writable),
        src_(src),
        info_(info),
        caps_(std::move(caps)),
        encoder_(std::move(encoder)) {
    writable_.begin_file({info.width, info.height});
    encoder_->encode({}, bytes_);
    if (bytes_.empty()) return;
    header_.reset(copied_buffer(std::as_bytes(std::span(bytes_))));
    caps_ = with_stream_header(std::move(caps_), header_.get());
    bytes_.clear();
  }

  const GstEventCameraInfo& info() const { return info_; }
  GstCaps* caps() const { return caps_.get(); }
  /// True once bytes were pushed.
  bool has_begun() const { return has_begun_; }
  /// True for words without a header, which have the sensor's size in their caps and may follow
  /// words of another sensor.
  bool is_words() const {
    return gst_structure_has_name(gst_caps_get_structure(caps(), 0), GST_EVENT_CAMERA_MEDIA_TYPE);
  }

  /// Writes a buffer of events, in buffers of at most `mtu` bytes.
  GstFlowReturn write(GstBuffer* buffer, guint mtu) {
    mtu_ = mtu;
    GstClockTime start = GST_BUFFER_PTS(buffer);
    GstFlowReturn result = GST_FLOW_OK;
    const bool encoded = writable_.write(buffer, [&](const auto& events) {
      if (result == GST_FLOW_OK) result = push_header(start);
      if (result != GST_FLOW_OK) return;
      const auto labels = encoder_->label(writable_.labels());
      writable_.written().lock()->labels += labels;
      result = encode_all(events, start);
    });
    if (!encoded) return GST_FLOW_ERROR;
    warn_of_pauses(false);
    if (result != GST_FLOW_OK) return result;
    GstClockTime duration = GST_BUFFER_DURATION(buffer);
    if (GST_CLOCK_TIME_IS_VALID(duration))
      duration -= std::min(duration, start - GST_BUFFER_PTS(buffer));
    return push_bytes(start, duration);
  }

  /// Queues triggers for the events of their interval. Writes them if too many are queued, since
  /// the stream then has no events.
  GstFlowReturn write(std::span<const Trigger> triggers, guint mtu) {
    mtu_ = mtu;
    triggers_.push(triggers);
    if (!triggers_.is_full()) return GST_FLOW_OK;
    ensure_segment(src_);
    const auto start = nanoseconds(*triggers_.first());
    if (const GstFlowReturn result = push_header(start); result != GST_FLOW_OK) return result;
    encode_triggers();
    writable_.advance_to(last_);
    return push_bytes(start, GST_CLOCK_TIME_NONE);
  }

  GstFlowReturn end(guint mtu) {
    mtu_ = mtu;
    ensure_segment(src_);
    GstFlowReturn result = push_header(GST_CLOCK_TIME_NONE);
    if (result != GST_FLOW_OK) return result;
    encode_triggers();
    for (bool more = true; more && result == GST_FLOW_OK;) {
      more = encoder_->finish(bytes_);
      result = push_bytes(GST_CLOCK_TIME_NONE, GST_CLOCK_TIME_NONE);
    }
    warn_of_pauses(true);
    auto patch = encoder_->patch();
    return result == GST_FLOW_OK && patch ? push_patch(*std::move(patch)) : result;
  }

  /// Warns of events that are lost because the stream was stopped before its end.
  void warn_of_pending() const {
    const auto pending = encoder_->pending();
    if (pending == 0) return;
    const Report report{GST_STREAM_ERROR_ENCODE,
                        "Lost " + std::to_string(pending) + " event" + (pending == 1 ? "" : "s") +
                            ", and the file is incomplete, because the stream was stopped before "
                            "its end. Send EOS first, as gst-launch-1.0 -e does."};
    GST_WARNING_OBJECT(element(), "%s", report.text.c_str());
    post_message(element(), GST_MESSAGE_WARNING, report,
                 "the format is written at the end of the stream");
  }

 private:
  GstFlowReturn push_header(GstClockTime pts) {
    const OwnedBuffer header = std::move(header_);
    if (!header) return GST_FLOW_OK;
    GstBuffer* const buffer = gst_buffer_copy(header.get());  // the original belongs to the caps
    GST_BUFFER_PTS(buffer) = pts;
    has_begun_ = true;
    return gst_pad_push(src_, buffer);
  }

  /// Pushes the encoded bytes in one buffer, or in several if the words of a silence exceed one.
  /// Only the last has a duration, because the interval continues after the others.
  GstFlowReturn push_bytes(GstClockTime pts, GstClockTime duration) {
    std::span<const guint8> bytes = bytes_;
    GstFlowReturn result = GST_FLOW_OK;
    while (!bytes.empty() && result == GST_FLOW_OK) {
      const auto piece = bytes.first(std::min(bytes.size(), capacity(mtu_)));
      bytes = bytes.subspan(piece.size());
      GstBuffer* const buffer = copied_buffer(std::as_bytes(piece));
      GST_BUFFER_PTS(buffer) = pts;
      if (bytes.empty()) GST_BUFFER_DURATION(buffer) = duration;
      GST_LOG_OBJECT(element(), "%" G_GSIZE_FORMAT " bytes at %" GST_TIME_FORMAT, piece.size(),
                     GST_TIME_ARGS(pts));
      has_begun_ = true;
      result = gst_pad_push(src_, buffer);
    }
    bytes_.clear();
    return result;
  }

  GstFlowReturn push_patch(FilePatch patch) {
    GST_DEBUG_OBJECT(element(),
                     "completing the header: %" G_GSIZE_FORMAT " bytes at %" G_GUINT64_FORMAT,
                     patch.bytes.size(), patch.position);
    if (!peer_can_seek(src_, GST_FORMAT_BYTES)) {
      GST_ELEMENT_WARNING(element(), STREAM, ENCODE,
                          ("The file header lacks the number of events. Write to a sink that can "
                           "seek, such as filesink, to complete it."),
                          ("downstream does not seek in bytes"));
      return GST_FLOW_OK;
    }
    GstSegment segment;
    gst_segment_init(&segment, GST_FORMAT_BYTES);
    segment.start = patch.position;
    gst_pad_push_event(src_, gst_event_new_segment(&segment));
    bytes_ = std::move(patch.bytes);
    return push_bytes(GST_CLOCK_TIME_NONE, GST_CLOCK_TIME_NONE);
  }

  /// Encodes events, and pushes each full buffer. `start` is the start time of the next buffer.
  GstFlowReturn encode(std::span<const AbsoluteEvent> events, GstClockTime& start) {
    const auto room = capacity(mtu_);
    while (!events.empty()) {
      const auto count = mtu_ == G_MAXUINT
                             ? events.size()
                             : count_that_fits(events, room - std::min(room, bytes_.size()));
      if (count == 0) {
        const auto end = std::max(start, nanoseconds(events.front().t));
        const GstFlowReturn result = push_bytes(start, end - start);
        if (result != GST_FLOW_OK) return result;
        start = end;
      }
      encoder_->encode(events.first(count), bytes_);
      if (count > 0) last_ = events[count - 1].t;
      events = events.subspan(count);
    }
    return GST_FLOW_OK;
  }

  /// Encodes events, and the queued triggers among them.
  GstFlowReturn encode_all(std::span<const AbsoluteEvent> events, GstClockTime& start) {
    if (events.empty()) return GST_FLOW_OK;
    std::span<const Trigger> triggers = triggers_.pop_before(events.back().t);
    GstFlowReturn result = GST_FLOW_OK;
    while (!events.empty() && result == GST_FLOW_OK) {
      const auto due = std::ranges::lower_bound(triggers, events.front().t, {}, &Trigger::t);
      encode(std::span(triggers.begin(), due));
      triggers = {due, triggers.end()};
      const auto next = triggers.empty() ? events.back().t : triggers.front().t;
      const auto end = std::ranges::upper_bound(events, next, {}, &AbsoluteEvent::t);
      const auto count = static_cast<std::size_t>(end - events.begin());
      result = encode(events.first(count), start);
      events = events.subspan(count);
    }
    return result;
  }

  /// Encodes triggers, except late ones.
  void encode(std::span<const Trigger> triggers) {
    for (const auto& trigger : triggers) {
      if (trigger.t < last_ || !encoder_->encode_trigger(trigger, bytes_)) {
        GST_LOG_OBJECT(element(),
                       "dropped a trigger of input %u at %" G_GINT64_FORMAT
                       " us: late, or the format has none",
                       unsigned{trigger.id}, gint64{trigger.t});
        continue;
      }
      last_ = trigger.t;
      ++writable_.written().lock()->triggers;
    }
  }

  void encode_triggers() { encode(triggers_.pop_before(after_all_items)); }

  /// Warns of the first pause that is removed, and at the end of the file of the total, if there
  /// are more.
  void warn_of_pauses(bool at_end) {
    const auto removed = encoder_->removed_time();
    const auto reported = pauses_reported_;
    if (removed == reported || (reported > 0 && !at_end)) return;
    pauses_reported_ = removed;
    const auto seconds = std::to_string(removed / 1'000'000) + " s";
    post_message(element(), GST_MESSAGE_WARNING,
                 {GST_STREAM_ERROR_ENCODE,
                  (reported == 0 ? "Removed a pause of " + seconds + ", which is"
                                 : "Removed pauses of " + seconds + " in total, which are") +
                      " too long for this format: later timestamps are shifted back by that much. "
                      "Write AEDAT4, HDF5, NumPy or text to keep them."},
                 "the clock of the format cannot represent " + std::to_string(removed) + " us");
  }

  GstElement* element() const { return GST_PAD_PARENT(src_); }

  WritableEvents& writable_;
  GstPad* src_;
  GstEventCameraInfo info_;
  OwnedCaps caps_;      ///< output caps
  OwnedBuffer header_;  ///< pending header; null once pushed, or if the format has none
  std::unique_ptr<Encoder> encoder_;
  std::vector<guint8> bytes_;  ///< encoded but not yet pushed
  guint mtu_ = G_MAXUINT;
  bool has_begun_ = false;
  WaitingItems<Trigger> triggers_;
  Microseconds last_ = 0;              ///< time of the last encoded item
  std::uint64_t pauses_reported_ = 0;  ///< removed microseconds that a warning reported
};

struct Settings {
  EventWriterFormat::Choice choice;
  guint mtu = G_MAXUINT;
};

}  // namespace

struct GstEventWriterPrivate {
  explicit GstEventWriterPrivate(GstElement* of)
      : element(of), writable(of, GST_CAT_DEFAULT, GST_STREAM_ERROR_ENCODE) {}

  GstElement* const element;
  GstPad* src = nullptr;
  Guarded<Settings> settings;
  WritableEvents writable;
  std::unique_ptr<WrittenFile> file;  ///< from caps to stop
};

#define GST_TYPE_EVENT_WRITER (gst_event_writer_get_type())
G_DECLARE_DERIVABLE_TYPE(GstEventWriter, gst_event_writer, GST, EVENT_WRITER, GstElement)

struct _GstEventWriterClass {
  GstElementClass parent_class;
  const EventWriterFormat* format;
};

G_DEFINE_ABSTRACT_TYPE_WITH_CODE(GstEventWriter, gst_event_writer, GST_TYPE_ELEMENT,
                                 G_ADD_PRIVATE(GstEventWriter)
                                     GST_DEBUG_CATEGORY_INIT(event_writer_debug, "eventwriter", 0,
                                                             "writers of event files"))

static GstEventWriterPrivate& priv_of(gpointer element) {
  return *static_cast<GstEventWriterPrivate*>(
      gst_event_writer_get_instance_private(GST_EVENT_WRITER(element)));
}

static Guarded<Settings>& settings_of(GObject* object) {
  return priv_of(object).settings;
}

static const EventWriterFormat& format_of(gpointer element) {
  return *GST_EVENT_WRITER_GET_CLASS(element)->format;
}

template <class Work>
static bool reported(GstEventWriterPrivate& self, const Work& work) {
  return catch_exceptions(
      self.element,
      [](const auto& error) {
        return WritableEvents::failure(error, {GST_STREAM_ERROR_ENCODE, "Cannot write the file."});
      },
      work);
}

static void begin_file(GstEventWriterPrivate& self, const GstEventCameraInfo& info,
                       OwnedCaps caps) {
  auto encoder = format_of(self.element)
                     .create({info.width, info.height}, self.settings.copy().choice, caps.get());
  self.file = std::make_unique<WrittenFile>(self.writable, self.src, info, std::move(encoder),
                                            std::move(caps));
}

/// Caps of this sensor that downstream accepts.
static OwnedCaps allowed_caps(GstPad* src, const GstEventCameraInfo& info) {
  const OwnedCaps own(gst_caps_make_writable(gst_pad_get_pad_template_caps(src)));
  for (guint i = 0; i < gst_caps_get_size(own.get()); ++i) {
    GstStructure* words = gst_caps_get_structure(own.get(), i);
    if (gst_structure_has_name(words, GST_EVENT_CAMERA_MEDIA_TYPE))
      gst_structure_set(words, "width", G_TYPE_INT, info.width, "height", G_TYPE_INT, info.height,
                        nullptr);
  }
  return OwnedCaps(gst_pad_peer_query_caps(src, own.get()));
}

static bool negotiate(GstEventWriterPrivate& self, const GstEventCameraInfo& info) {
  OwnedCaps caps = allowed_caps(self.src, info);
  if (gst_caps_is_empty(caps.get())) {
    const OwnedCaps accepted(gst_pad_peer_query_caps(self.src, nullptr));
    GST_ELEMENT_ERROR(self.element, STREAM, FORMAT,
                      ("Downstream does not take this format, or not from a sensor of %s. Correct "
                       "the caps after this element.",
                       in_pixels({info.width, info.height}).c_str()),
                      ("downstream accepts %" GST_PTR_FORMAT, accepted.get()));
    return false;
  }
  caps.reset(gst_caps_truncate(caps.release()));
  if (const auto fixate = format_of(self.element).fixate)
    caps.reset(fixate(info, self.settings.copy().choice.variant, caps.release()));
  if (!gst_caps_is_fixed(caps.get())) return false;
  GST_DEBUG_OBJECT(self.element, "writing the events of %dx%d pixels as %" GST_PTR_FORMAT,
                   info.width, info.height, caps.get());
  begin_file(self, info, std::move(caps));
  return gst_pad_push_event(self.src, gst_event_new_caps(self.file->caps())) != FALSE;
}

/// Caps that the sink pad accepts: the sensors that the format holds, and then all others, which
/// the encoder refuses with a reason. Upstream prefers the first.
static OwnedCaps sink_caps(GstPad* pad) {
  GstCaps* caps = gst_caps_make_writable(gst_pad_get_pad_template_caps(pad));
  gst_caps_append(caps, gst_caps_from_string(GST_EVENT_CAMERA_MEDIA_TYPE ", format=XYTP"));
  return OwnedCaps(caps);
}

static gboolean sink_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  GstCaps* asked = nullptr;
  switch (GST_QUERY_TYPE(query)) {
    case GST_QUERY_CAPS: {
      gst_query_parse_caps(query, &asked);
      OwnedCaps caps = sink_caps(pad);
      if (asked != nullptr)
        caps.reset(gst_caps_intersect_full(asked, caps.get(), GST_CAPS_INTERSECT_FIRST));
      gst_query_set_caps_result(query, caps.get());
      return TRUE;
    }
    case GST_QUERY_ACCEPT_CAPS:
      gst_query_parse_accept_caps(query, &asked);
      gst_query_set_accept_caps_result(query, gst_caps_is_subset(asked, sink_caps(pad).get()));
      return TRUE;
    default:
      return gst_pad_query_default(pad, parent, query);
  }
}

static GstFlowReturn chain(GstPad*, GstObject* parent, GstBuffer* received) {
  auto& self = priv_of(parent);
  const OwnedBuffer buffer(received);
  if (!self.file) return GST_FLOW_NOT_NEGOTIATED;
  GstFlowReturn result = GST_FLOW_ERROR;
  reported(self, [&] { result = self.file->write(received, self.settings.copy().mtu); });
  return result;
}

static void end_file(GstEventWriterPrivate& self) {
  if (!self.file) return;
  self.writable.end_file();
  reported(self, [&] { self.file->end(self.settings.copy().mtu); });
}

static gboolean handle_caps(GstEventWriterPrivate& self, const GstCaps* caps) {
  GstEventCameraInfo info;
  if (!gst_event_camera_info_from_caps(&info, caps)) {
    GST_ERROR_OBJECT(self.element, "%" GST_PTR_FORMAT " are not event caps", caps);
    return FALSE;
  }
  if (self.file && self.file->info().width == info.width && self.file->info().height == info.height)
    return TRUE;
  if (self.file && self.file->has_begun()) {
    if (!self.file->is_words() && !self.writable.accepts({info.width, info.height})) return FALSE;
    end_file(self);
  }
  return reported(self, [&] { return negotiate(self, info); });
}

static gboolean sink_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  auto& self = priv_of(parent);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      const OwnedEvent owned(event);
      return handle_caps(self, caps_of(event));
    }
    case GST_EVENT_SEGMENT:
      if (!plays_forwards(self.element, event, "write")) return FALSE;
      self.writable.begin_segment(segment_of(event),
                                  self.file && !self.file->is_words() && is_simulated(pad));
      break;
    case GST_EVENT_EOS:
      end_file(self);
      break;
    case GST_EVENT_FLUSH_STOP:  // filesink has truncated the file, and a decoder expects a header
      if (self.file)
        reported(self, [&] {
          begin_file(self, self.file->info(), OwnedCaps(gst_caps_ref(self.file->caps())));
        });
      break;
    case GST_EVENT_CUSTOM_DOWNSTREAM:
      if (const auto triggers = triggers_of(event)) {
        gst_event_unref(event);
        return !self.file || reported(self, [&] {
          return self.file->write(*triggers, self.settings.copy().mtu) == GST_FLOW_OK;
        });
      }
      break;
    default:
      break;
  }
  return gst_pad_event_default(pad, parent, event);
}

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_event_writer_parent_class)->change_state(element, transition);
  auto& self = priv_of(element);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY && self.file) {
    self.writable.end_file();
    self.file->warn_of_pending();
    self.file.reset();
  }
  return result;
}

static EventWriterFormat::Choice default_choice(const EventWriterFormat& format) {
  EventWriterFormat::Choice choice;
  if (format.variants != nullptr) choice.variant = format.variants->default_value;
  if (format.compressions != nullptr) choice.compression = format.compressions->default_value;
  return choice;
}

/// Creates the pads here, because the format is not yet known in init.
static void constructed(GObject* object) {
  auto& self = priv_of(object);
  self.settings.lock()->choice = default_choice(format_of(object));
  GstPad* const sink = add_pad(self.element, "sink");
  gst_pad_set_chain_function(sink, chain);
  gst_pad_set_event_function(sink, sink_event);
  gst_pad_set_query_function(sink, sink_query);
  self.src = add_pad(self.element, "src");
  G_OBJECT_CLASS(gst_event_writer_parent_class)->constructed(object);
}

static void finalize(GObject* object) {
  std::destroy_at(&priv_of(object));
  G_OBJECT_CLASS(gst_event_writer_parent_class)->finalize(object);
}

static void gst_event_writer_init(GstEventWriter* self) {
  std::construct_at(&priv_of(self), GST_ELEMENT(self));
}

static void gst_event_writer_class_init(GstEventWriterClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->constructed = constructed;
  object_class->finalize = finalize;
  GST_ELEMENT_CLASS(klass)->change_state = change_state;
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_WRITER, static_cast<GstPluginAPIFlags>(0));
}

static void format_class_init(gpointer klass, gpointer data) {
  const auto& format = *static_cast<const EventWriterFormat*>(data);
  GST_EVENT_WRITER_CLASS(klass)->format = &format;
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  Settings defaults;
  defaults.choice = default_choice(format);
  Properties<settings_of> properties(object_class, defaults);
  if (const auto* variants = format.variants)
    properties.add_fixed([](Settings& settings) -> int& { return settings.choice.variant; },
                         variants->property, variants->blurb, variants->type());
  if (const auto* compressions = format.compressions)
    properties.add_fixed([](Settings& settings) -> int& { return settings.choice.compression; },
                         compressions->property, compressions->blurb, compressions->type());
  if (format.has_words)
    properties.add(&Settings::mtu, "mtu",
                   "Maximum size of a buffer of words in bytes, such as the payload of a network "
                   "packet; words are never split",
                   64, G_MAXUINT);
  install_stats(
      object_class, [](GObject* object) { return priv_of(object).writable.stats(); },
      WritableEvents::stats_blurb);
  auto* element_class = GST_ELEMENT_CLASS(klass);
  add_pad_template(
      element_class, "sink", GST_PAD_SINK,
      OwnedCaps(gst_caps_new_simple(GST_EVENT_CAMERA_MEDIA_TYPE, "format", G_TYPE_STRING, "XYTP",
                                    "width", GST_TYPE_INT_RANGE, 1, format.max_side, "height",
                                    GST_TYPE_INT_RANGE, 1, format.max_side, nullptr)));
  add_pad_template(element_class, "src", GST_PAD_SRC, format.caps);
  set_metadata(klass, format.long_name, "Codec/Encoder", format.description);
  set_output_extensions(element_class, format.caps);
}

GType event_writer_type(const EventWriterFormat& format) {
  return row_type(GST_TYPE_EVENT_WRITER, format.type_name, format_class_init, &format);
}
