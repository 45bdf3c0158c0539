// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-evtenc
 * @title: evtenc
 * @short_description: writes RAW files and EVT words
 *
 * Writes events as one of Prophesee's RAW files, of words as #GstEvtEnc:format says. Where
 * downstream asks for `application/x-event-camera` with the format EVT2, EVT21, EVT3 or EVT4, it
 * gives these words without a header.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 v4l2src ! eventsim-diff ! evtenc format=EVT3 ! filesink location=out.raw
 * ]|
 */
#include <atomic>

#include "elements/eventcam/evtformat.hpp"
#include "gst/base/eventencoder.hpp"
#include "src/formats/evt/raw.hpp"

namespace {

enum Property : guint { prop_format = 1 };

struct GstEvtEnc {
  GstEventEncoder parent;
  std::atomic<int> format;
};

struct GstEvtEncClass {
  GstEventEncoderClass parent_class;
};

using eventcamera::EvtFormat;
constexpr EvtFormat default_format = EvtFormat::evt3;

}  // namespace

#define GST_EVT_ENC(object) (reinterpret_cast<GstEvtEnc*>(object))

#define GST_TYPE_EVT_FORMAT (gst_evt_format_get_type())
static GType gst_evt_format_get_type() {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<int>(EvtFormat::evt2), "Words of 32 bits, an event each", "EVT2"},
        {static_cast<int>(EvtFormat::evt21), "Words of 64 bits, up to 32 events each", "EVT21"},
        {static_cast<int>(EvtFormat::evt3), "Words of 16 bits, the most compact", "EVT3"},
        {static_cast<int>(EvtFormat::evt4), "Words of 32 bits, vectors of events", "EVT4"},
        {0, nullptr, nullptr},
    };
    return g_enum_register_static("GstEvtFormat", values);
  }();
  return type;
}

G_DEFINE_TYPE(GstEvtEnc, gst_evt_enc, GST_TYPE_EVENT_ENCODER)
GST_ELEMENT_REGISTER_DEFINE(evtenc, "evtenc", GST_RANK_PRIMARY, gst_evt_enc_get_type())

static void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  if (id == prop_format)
    GST_EVT_ENC(object)->format = g_value_get_enum(value);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
}

static void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  if (id == prop_format)
    g_value_set_enum(value, GST_EVT_ENC(object)->format);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
}

static const char* name_of(int format) {
  auto* klass = static_cast<GEnumClass*>(g_type_class_peek_static(GST_TYPE_EVT_FORMAT));
  return g_enum_get_value(klass, format)->value_nick;
}

/// Of words, the format of the property where downstream takes it, else any that it takes.
static GstCaps* fixate(GstEventEncoder* self, const GstEventCameraInfo& info, GstCaps* caps) {
  caps = gst_caps_make_writable(caps);
  GstStructure* structure = gst_caps_get_structure(caps, 0);
  if (gst_structure_has_name(structure, GST_EVENT_CAMERA_MEDIA_TYPE)) {
    gst_structure_fixate_field_string(structure, "format", name_of(GST_EVT_ENC(self)->format));
    gst_structure_fixate_field_nearest_int(structure, "width", info.width);
    gst_structure_fixate_field_nearest_int(structure, "height", info.height);
    gst_structure_fixate_field_nearest_fraction(structure, "framerate", info.fps_n, info.fps_d);
  }
  return gst_caps_fixate(caps);
}

static std::unique_ptr<eventcamera::Encoder> create(GstEventEncoder* self,
                                                    const GstEventCameraInfo& info,
                                                    const GstCaps* caps) {
  const eventcamera::SensorSize size{info.width, info.height};
  const auto* words = gst_structure_get_string(gst_caps_get_structure(caps, 0), "format");
  if (const auto format = evt_format_named(words)) return make_evt_encoder(*format, size);
  return make_prophesee_raw_encoder(static_cast<EvtFormat>(GST_EVT_ENC(self)->format.load()), size);
}

static void gst_evt_enc_init(GstEvtEnc* self) {
  self->format = static_cast<int>(default_format);
}

static void gst_evt_enc_class_init(GstEvtEncClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  g_object_class_install_property(
      object_class, prop_format,
      g_param_spec_enum("format", "Format",
                        "The words to write; taken when the stream begins. Where downstream asks "
                        "for words without a header, its own wish counts",
                        GST_TYPE_EVT_FORMAT, static_cast<int>(default_format),
                        static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                                 GST_PARAM_MUTABLE_READY)));
  GstEventEncoderClass* encoder_class = GST_EVENT_ENCODER_CLASS(klass);
  encoder_class->create = create;
  encoder_class->fixate = fixate;
  gst_event_encoder_class_add_pads(encoder_class, 2048, 2048,
                                   "application/x-prophesee-raw; " EVT_WORDS_CAPS);

  gst_element_class_set_static_metadata(
      GST_ELEMENT_CLASS(klass), "Prophesee RAW writer", "Codec/Encoder",
      "Writes events as Prophesee RAW, or as EVT words", "gst-eventsim");
  gst_type_mark_as_plugin_api(GST_TYPE_EVT_FORMAT, static_cast<GstPluginAPIFlags>(0));
}
