// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventwriter.hpp"

#include <atomic>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "gst/base/buffer_bytes.hpp"
#include "gst/base/errors.hpp"
#include "gst/base/owned.hpp"
#include "gst/base/types.hpp"
#include "gst/base/writable_events.hpp"

GST_DEBUG_CATEGORY_STATIC(event_writer_debug);
#define GST_CAT_DEFAULT event_writer_debug

using eventcamera::Encoder;

namespace {

constexpr guint prop_variant = 1;

/// State of the file being written, from caps to stop.
struct State {
  GstEventCameraInfo info;
  OwnedCaps caps;  ///< output caps
  std::unique_ptr<Encoder> encoder;
  bool written = false;
};

}  // namespace

struct GstEventWriterPrivate {
  explicit GstEventWriterPrivate(GstElement* self) : writable(self, GST_STREAM_ERROR_ENCODE) {}

  std::atomic<int> variant = 0;
  GstPad* sink = nullptr;
  GstPad* src = nullptr;

  // Accessed by the streaming thread only, or while there is none.
  std::optional<State> state;
  WritableEvents writable;
  std::vector<guint8> bytes;  ///< encoded but not yet pushed
};

#define GST_TYPE_EVENT_WRITER (gst_event_writer_get_type())
G_DECLARE_DERIVABLE_TYPE(GstEventWriter, gst_event_writer, GST, EVENT_WRITER, GstElement)

struct _GstEventWriterClass {
  GstElementClass parent_class;
  const EventFileFormat* format;
};

G_DEFINE_ABSTRACT_TYPE_WITH_CODE(GstEventWriter, gst_event_writer, GST_TYPE_ELEMENT,
                                 G_ADD_PRIVATE(GstEventWriter)
                                     GST_DEBUG_CATEGORY_INIT(event_writer_debug, "eventwriter", 0,
                                                             "writers of event files"))

static GstEventWriterPrivate& priv_of(GstEventWriter* self) {
  return *static_cast<GstEventWriterPrivate*>(gst_event_writer_get_instance_private(self));
}

static const EventFileFormat& format_of(GstEventWriter* self) {
  return *GST_EVENT_WRITER_GET_CLASS(self)->format;
}

/// Runs `work`; reports any exception.
template <class Work>
static GstFlowReturn reported(GstEventWriter* self, const Work& work) {
  return guarded(
      self,
      [](const auto& error) {
        return WritableEvents::failure(error, {GST_STREAM_ERROR_ENCODE, "Cannot write the file."});
      },
      work);
}

/* negotiation */

/// Begins a file. May throw.
static void begin_file(GstEventWriter* self, const GstEventCameraInfo& info, OwnedCaps caps) {
  auto& priv = priv_of(self);
  priv.bytes.clear();
  priv.writable.begin_file({info.width, info.height});
  auto encoder = format_of(self).create({info.width, info.height}, priv.variant, caps.get());
  priv.state.emplace(State{.info = info, .caps = std::move(caps), .encoder = std::move(encoder)});
}

static GstFlowReturn negotiate(GstEventWriter* self, const GstEventCameraInfo& info) {
  auto& priv = priv_of(self);
  const auto fixate = format_of(self).fixate;
  GstCaps* caps = gst_pad_get_allowed_caps(priv.src);
  if (caps == nullptr) caps = gst_pad_get_pad_template_caps(priv.src);
  if (!gst_caps_is_empty(caps)) {
    caps = gst_caps_truncate(caps);
    if (fixate != nullptr) caps = fixate(info, priv.variant, caps);
  }
  OwnedCaps fixed(caps);
  if (!gst_caps_is_fixed(fixed.get())) return GST_FLOW_NOT_NEGOTIATED;
  begin_file(self, info, std::move(fixed));
  return gst_pad_push_event(priv.src, gst_event_new_caps(priv.state->caps.get()))
             ? GST_FLOW_OK
             : GST_FLOW_NOT_NEGOTIATED;
}

static gboolean take_caps(GstEventWriter* self, GstEvent* event) {
  const auto& priv = priv_of(self);
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  GstEventCameraInfo info;
  if (!gst_event_camera_info_from_caps(&info, caps)) {
    GST_ERROR_OBJECT(self, "%" GST_PTR_FORMAT " are not event caps", caps);
    return FALSE;
  }
  if (priv.state && priv.state->info.width == info.width && priv.state->info.height == info.height)
    return TRUE;
  if (priv.state && priv.state->written && !priv.writable.accepts({info.width, info.height}))
    return FALSE;
  return reported(self, [&] { return negotiate(self, info); }) == GST_FLOW_OK;
}

/* data */

/// Pushes the encoded bytes. May throw.
static GstFlowReturn push_bytes(GstEventWriter* self, GstClockTime pts, GstClockTime duration) {
  auto& priv = priv_of(self);
  if (priv.bytes.empty()) return GST_FLOW_OK;
  GstBuffer* buffer = copied_buffer(std::as_bytes(std::span(priv.bytes)));
  priv.bytes.clear();
  GST_BUFFER_PTS(buffer) = pts;
  GST_BUFFER_DURATION(buffer) = duration;
  priv.state->written = true;
  return gst_pad_push(priv.src, buffer);
}

static GstFlowReturn chain(GstPad*, GstObject* parent, GstBuffer* taken) {
  auto* self = GST_EVENT_WRITER(parent);
  auto& priv = priv_of(self);
  const OwnedBuffer buffer(taken);
  if (!priv.state) return GST_FLOW_NOT_NEGOTIATED;
  return reported(self, [&] {
    const bool encoded = priv.writable.take(
        taken, [&](const auto& events) { priv.state->encoder->encode(events, priv.bytes); });
    return encoded ? push_bytes(self, GST_BUFFER_PTS(taken), GST_BUFFER_DURATION(taken))
                   : GST_FLOW_ERROR;
  });
}

/// Overwrites part of the header. May throw.
static GstFlowReturn push_patch(GstEventWriter* self, eventcamera::FilePatch patch) {
  auto& priv = priv_of(self);
  if (!can_seek_bytes(priv.src)) {
    GST_ELEMENT_WARNING(self, STREAM, ENCODE,
                        ("The file header lacks the number of events. Write to a sink that can "
                         "seek, such as filesink, to complete it."),
                        ("downstream does not seek in bytes"));
    return GST_FLOW_OK;
  }
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_BYTES);
  segment.start = patch.position;
  gst_pad_push_event(priv.src, gst_event_new_segment(&segment));
  priv.bytes = std::move(patch.bytes);
  return push_bytes(self, GST_CLOCK_TIME_NONE, GST_CLOCK_TIME_NONE);
}

static void end_file(GstEventWriter* self) {
  auto& priv = priv_of(self);
  if (!priv.state) return;
  priv.writable.end_file();
  reported(self, [&] {
    priv.state->encoder->finish(priv.bytes);
    const GstFlowReturn result = push_bytes(self, GST_CLOCK_TIME_NONE, GST_CLOCK_TIME_NONE);
    auto patch = priv.state->encoder->patch();
    return result == GST_FLOW_OK && patch ? push_patch(self, *std::move(patch)) : result;
  });
}

/// After a flush: filesink has truncated the file, and a decoder expects a header.
static void start_over(GstEventWriter* self) {
  const auto& state = priv_of(self).state;
  if (!state) return;
  reported(self, [&] {
    begin_file(self, state->info, OwnedCaps(gst_caps_ref(state->caps.get())));
    return GST_FLOW_OK;
  });
}

static gboolean sink_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  auto* self = GST_EVENT_WRITER(parent);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      const gboolean taken = take_caps(self, event);
      gst_event_unref(event);
      return taken;
    }
    case GST_EVENT_EOS:
      end_file(self);
      break;
    case GST_EVENT_FLUSH_STOP:
      start_over(self);
      break;
    default:
      break;
  }
  return gst_pad_event_default(pad, parent, event);
}

/* states */

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_event_writer_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    auto& priv = priv_of(GST_EVENT_WRITER(element));
    if (priv.state) priv.writable.end_file();
    priv.state.reset();
    priv.bytes.clear();
  }
  return result;
}

/* type */

static void set_property(GObject* object, guint, const GValue* value, GParamSpec*) {
  priv_of(GST_EVENT_WRITER(object)).variant = g_value_get_enum(value);
}

static void get_property(GObject* object, guint, GValue* value, GParamSpec*) {
  g_value_set_enum(value, priv_of(GST_EVENT_WRITER(object)).variant);
}

/// Creates the pads here, because the format is not yet known in init.
static void constructed(GObject* object) {
  auto* element = GST_ELEMENT(object);
  auto* element_class = GST_ELEMENT_GET_CLASS(element);
  auto& priv = priv_of(GST_EVENT_WRITER(object));
  if (const auto* variants = format_of(GST_EVENT_WRITER(object)).variants)
    priv.variant = variants->default_value;
  priv.sink =
      gst_pad_new_from_template(gst_element_class_get_pad_template(element_class, "sink"), "sink");
  gst_pad_set_chain_function(priv.sink, chain);
  gst_pad_set_event_function(priv.sink, sink_event);
  gst_element_add_pad(element, priv.sink);
  priv.src =
      gst_pad_new_from_template(gst_element_class_get_pad_template(element_class, "src"), "src");
  gst_element_add_pad(element, priv.src);
  G_OBJECT_CLASS(gst_event_writer_parent_class)->constructed(object);
}

static void finalize(GObject* object) {
  std::destroy_at(&priv_of(GST_EVENT_WRITER(object)));
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

static void add_pad_template(GstElementClass* klass, const char* name, GstPadDirection direction,
                             const OwnedCaps& caps) {
  gst_element_class_add_pad_template(
      klass, gst_pad_template_new(name, direction, GST_PAD_ALWAYS, caps.get()));
}

static void format_class_init(gpointer klass, gpointer data) {
  const auto& format = *static_cast<const EventFileFormat*>(data);
  GST_EVENT_WRITER_CLASS(klass)->format = &format;
  if (const auto* variants = format.variants) {
    GObjectClass* object_class = G_OBJECT_CLASS(klass);
    object_class->set_property = set_property;
    object_class->get_property = get_property;
    g_object_class_install_property(
        object_class, prop_variant,
        g_param_spec_enum(variants->property, variants->nick, variants->blurb, variants->type(),
                          variants->default_value,
                          static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                                   GST_PARAM_MUTABLE_READY)));
  }
  auto* element_class = GST_ELEMENT_CLASS(klass);
  add_pad_template(
      element_class, "sink", GST_PAD_SINK,
      OwnedCaps(gst_caps_new_simple(GST_EVENT_CAMERA_MEDIA_TYPE, "format", G_TYPE_STRING, "XYTP",
                                    "width", GST_TYPE_INT_RANGE, 1, format.max_width, "height",
                                    GST_TYPE_INT_RANGE, 1, format.max_height, nullptr)));
  add_pad_template(element_class, "src", GST_PAD_SRC, OwnedCaps(gst_caps_from_string(format.caps)));
  gst_element_class_set_static_metadata(element_class, format.long_name, "Codec/Encoder",
                                        format.description, "gst-eventsim");
}

GType event_writer_type(const EventFileFormat& format) {
  return row_type(GST_TYPE_EVENT_WRITER, format.type_name, format_class_init, &format);
}
