// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventencoder.hpp"

#include <exception>
#include <new>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "gst/base/copied_buffer.hpp"
#include "gst/base/owned.hpp"
#include "gst/base/writable_events.hpp"

GST_DEBUG_CATEGORY_STATIC(event_encoder_debug);
#define GST_CAT_DEFAULT event_encoder_debug

using eventcamera::Encoder;
using eventcamera::Microseconds;

namespace {

/// Encoded at once, so that events stay in the cache.
constexpr std::size_t encoded_events = 1 << 14;

/// The file that is written, from caps to stop.
struct State {
  GstEventCameraInfo info;
  OwnedCaps caps;  ///< of the output
  std::unique_ptr<Encoder> encoder;
  bool written = false;
};

}  // namespace

struct GstEventEncoderPrivate {
  explicit GstEventEncoderPrivate(GstElement* self) : writable(self, GST_STREAM_ERROR_ENCODE) {}

  GstPad* sink = nullptr;
  GstPad* src = nullptr;

  // The streaming thread's, or nobody's while there is none.
  std::unique_ptr<State> state;
  WritableEvents writable;
  std::vector<guint8> bytes;
};

G_DEFINE_ABSTRACT_TYPE_WITH_CODE(GstEventEncoder, gst_event_encoder, GST_TYPE_ELEMENT,
                                 GST_DEBUG_CATEGORY_INIT(event_encoder_debug, "eventencoder", 0,
                                                         "writers of event files"))

/// Runs what may throw; an exception is an error of the element.
template <class Work>
static GstFlowReturn guarded(GstEventEncoder* self, const Work& work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    GST_ELEMENT_ERROR(self, RESOURCE, NO_SPACE_LEFT,
                      ("There is not enough memory to write the events."), (nullptr));
  } catch (const std::invalid_argument& error) {
    GST_ELEMENT_ERROR(self, STREAM, FORMAT, ("This cannot be written: %s.", error.what()),
                      (nullptr));
  } catch (const std::exception& error) {
    GST_ELEMENT_ERROR(self, STREAM, ENCODE, ("The events cannot be written."),
                      ("%s", error.what()));
  }
  return GST_FLOW_ERROR;
}

/* negotiation */

/// Begins a file. May throw.
static void begin_file(GstEventEncoder* self, const GstEventCameraInfo& info, OwnedCaps caps) {
  auto* priv = self->priv;
  priv->bytes.clear();
  priv->writable.begin_file({info.width, info.height});
  auto encoder = GST_EVENT_ENCODER_GET_CLASS(self)->create(self, info, caps.get());
  priv->state = std::make_unique<State>(
      State{.info = info, .caps = std::move(caps), .encoder = std::move(encoder)});
}

static GstFlowReturn negotiate(GstEventEncoder* self, const GstEventCameraInfo& info) {
  auto* priv = self->priv;
  const auto* klass = GST_EVENT_ENCODER_GET_CLASS(self);
  GstCaps* caps = gst_pad_get_allowed_caps(priv->src);
  if (caps == nullptr) caps = gst_pad_get_pad_template_caps(priv->src);
  if (!gst_caps_is_empty(caps)) {
    caps = gst_caps_truncate(caps);
    if (klass->fixate != nullptr) caps = klass->fixate(self, info, caps);
  }
  OwnedCaps fixed(caps);
  if (!gst_caps_is_fixed(fixed.get())) return GST_FLOW_NOT_NEGOTIATED;
  begin_file(self, info, std::move(fixed));
  return gst_pad_push_event(priv->src, gst_event_new_caps(priv->state->caps.get()))
             ? GST_FLOW_OK
             : GST_FLOW_NOT_NEGOTIATED;
}

static gboolean take_caps(GstEventEncoder* self, GstEvent* event) {
  auto* priv = self->priv;
  GstCaps* caps = nullptr;
  gst_event_parse_caps(event, &caps);
  GstEventCameraInfo info;
  if (!gst_event_camera_info_from_caps(&info, caps)) {
    GST_ERROR_OBJECT(self, "%" GST_PTR_FORMAT " are no events", caps);
    return FALSE;
  }
  if (priv->state && priv->state->info.width == info.width &&
      priv->state->info.height == info.height)
    return TRUE;
  if (priv->state && priv->state->written) {
    GST_ELEMENT_ERROR(self, STREAM, FORMAT,
                      ("The size of the sensor changes from %dx%d to %dx%d, but a file has one.",
                       priv->state->info.width, priv->state->info.height, info.width, info.height),
                      (nullptr));
    return FALSE;
  }
  return guarded(self, [&] { return negotiate(self, info); }) == GST_FLOW_OK;
}

/* data */

/// Pushes what is encoded. May throw.
static GstFlowReturn push_bytes(GstEventEncoder* self, GstClockTime pts, GstClockTime duration) {
  auto& bytes = self->priv->bytes;
  if (bytes.empty()) return GST_FLOW_OK;
  GstBuffer* buffer = copied_buffer(std::as_bytes(std::span(bytes)));
  bytes.clear();
  GST_BUFFER_PTS(buffer) = pts;
  GST_BUFFER_DURATION(buffer) = duration;
  self->priv->state->written = true;
  return gst_pad_push(self->priv->src, buffer);
}

/// Encodes the events of a buffer. May throw.
static void encode(GstEventEncoder* self, const GstEventCameraMap& map) {
  auto* priv = self->priv;
  const auto start = static_cast<Microseconds>(map.start);
  for (std::span left(map.events, map.n_events); !left.empty();) {
    const auto few = left.first(std::min(left.size(), encoded_events));
    left = left.subspan(few.size());
    priv->state->encoder->encode(priv->writable.pick(few, start), priv->bytes);
  }
}

static GstFlowReturn take_buffer(GstEventEncoder* self, GstBuffer* buffer) {
  if (!self->priv->state) return GST_FLOW_NOT_NEGOTIATED;
  GstEventCameraMap map;
  if (GST_BUFFER_PTS(buffer) > G_MAXINT64 || !gst_event_camera_map(&map, buffer)) {
    GST_ELEMENT_ERROR(self, STREAM, FORMAT,
                      ("A buffer is no event buffer: it has no PTS, or no whole number of events."),
                      (nullptr));
    return GST_FLOW_ERROR;
  }
  const GstFlowReturn result = guarded(self, [&] {
    encode(self, map);
    return push_bytes(self, GST_BUFFER_PTS(buffer), GST_BUFFER_DURATION(buffer));
  });
  gst_event_camera_unmap(&map);
  return result;
}

static GstFlowReturn chain(GstPad*, GstObject* parent, GstBuffer* buffer) {
  const GstFlowReturn result = take_buffer(GST_EVENT_ENCODER(parent), buffer);
  gst_buffer_unref(buffer);
  return result;
}

static bool can_go_back(GstEventEncoder* self) {
  GstQuery* query = gst_query_new_seeking(GST_FORMAT_BYTES);
  gboolean seekable = FALSE;
  if (gst_pad_peer_query(self->priv->src, query))
    gst_query_parse_seeking(query, nullptr, &seekable, nullptr, nullptr);
  gst_query_unref(query);
  return seekable;
}

/// May throw.
static GstFlowReturn push_patch(GstEventEncoder* self, GstEventEncoderPatch patch) {
  if (!can_go_back(self)) {
    GST_ELEMENT_WARNING(self, STREAM, ENCODE,
                        ("The header does not tell how many events there are: what is downstream "
                         "cannot go back to it."),
                        (nullptr));
    return GST_FLOW_OK;
  }
  GstSegment segment;
  gst_segment_init(&segment, GST_FORMAT_BYTES);
  segment.start = patch.position;
  gst_pad_push_event(self->priv->src, gst_event_new_segment(&segment));
  self->priv->bytes = std::move(patch.bytes);
  return push_bytes(self, GST_CLOCK_TIME_NONE, GST_CLOCK_TIME_NONE);
}

static void finish(GstEventEncoder* self) {
  auto* priv = self->priv;
  if (!priv->state) return;
  priv->writable.end_file();
  guarded(self, [&] {
    priv->state->encoder->finish(priv->bytes);
    const GstFlowReturn result = push_bytes(self, GST_CLOCK_TIME_NONE, GST_CLOCK_TIME_NONE);
    const auto patch = GST_EVENT_ENCODER_GET_CLASS(self)->patch;
    if (result != GST_FLOW_OK || patch == nullptr) return result;
    return push_patch(self, patch(*priv->state->encoder));
  });
}

/// Downstream has let go of the file: filesink has emptied it, and a decoder expects a header.
static void begin_anew(GstEventEncoder* self) {
  const auto& state = self->priv->state;
  if (!state) return;
  guarded(self, [&] {
    begin_file(self, state->info, OwnedCaps(gst_caps_ref(state->caps.get())));
    return GST_FLOW_OK;
  });
}

static gboolean sink_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  auto* self = GST_EVENT_ENCODER(parent);
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      const gboolean taken = take_caps(self, event);
      gst_event_unref(event);
      return taken;
    }
    case GST_EVENT_EOS:
      finish(self);
      break;
    case GST_EVENT_FLUSH_STOP:
      begin_anew(self);
      break;
    default:
      break;
  }
  return gst_pad_event_default(pad, parent, event);
}

/* states */

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_event_encoder_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    auto* priv = GST_EVENT_ENCODER(element)->priv;
    if (priv->state) priv->writable.end_file();
    priv->state.reset();
    priv->bytes.clear();
  }
  return result;
}

/* type */

void gst_event_encoder_class_add_pads(GstEventEncoderClass* klass, int max_width, int max_height,
                                      const char* src_caps) {
  const OwnedCaps in(gst_caps_new_simple(GST_EVENT_CAMERA_MEDIA_TYPE, "format", G_TYPE_STRING,
                                         "XYTP", "width", GST_TYPE_INT_RANGE, 1, max_width,
                                         "height", GST_TYPE_INT_RANGE, 1, max_height, nullptr));
  const OwnedCaps out(gst_caps_from_string(src_caps));
  auto* element_class = GST_ELEMENT_CLASS(klass);
  gst_element_class_add_pad_template(
      element_class, gst_pad_template_new("sink", GST_PAD_SINK, GST_PAD_ALWAYS, in.get()));
  gst_element_class_add_pad_template(
      element_class, gst_pad_template_new("src", GST_PAD_SRC, GST_PAD_ALWAYS, out.get()));
}

/// The pads are those of the subclass, which is not yet known in init.
static void constructed(GObject* object) {
  auto* element = GST_ELEMENT(object);
  auto* priv = GST_EVENT_ENCODER(object)->priv;
  auto* element_class = GST_ELEMENT_GET_CLASS(element);
  priv->sink =
      gst_pad_new_from_template(gst_element_class_get_pad_template(element_class, "sink"), "sink");
  gst_pad_set_chain_function(priv->sink, chain);
  gst_pad_set_event_function(priv->sink, sink_event);
  gst_element_add_pad(element, priv->sink);
  priv->src =
      gst_pad_new_from_template(gst_element_class_get_pad_template(element_class, "src"), "src");
  gst_element_add_pad(element, priv->src);
  G_OBJECT_CLASS(gst_event_encoder_parent_class)->constructed(object);
}

static void finalize(GObject* object) {
  delete GST_EVENT_ENCODER(object)->priv;
  G_OBJECT_CLASS(gst_event_encoder_parent_class)->finalize(object);
}

static void gst_event_encoder_init(GstEventEncoder* self) {
  self->priv = new GstEventEncoderPrivate(GST_ELEMENT(self));
}

static void gst_event_encoder_class_init(GstEventEncoderClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->constructed = constructed;
  object_class->finalize = finalize;
  GST_ELEMENT_CLASS(klass)->change_state = change_state;
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_ENCODER, static_cast<GstPluginAPIFlags>(0));
}
