// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventcsvenc
 * @title: eventcsvenc
 * @short_description: writes text files of events
 *
 * Writes a line for each event, as #GstEventCsvEnc:dialect says.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 videotestsrc num-buffers=90 ! eventsim-diff ! eventcsvenc dialect=rpg ! filesink
 * location=events.txt
 * ]|
 */
#include <atomic>
#include <vector>

#include "gst/base/eventencoder.hpp"
#include "src/formats/text/csv_encoder.hpp"

namespace {

enum Property : guint { prop_dialect = 1 };

struct GstEventCsvEnc {
  GstEventEncoder parent;
  std::atomic<int> dialect;  ///< its place among csv_dialects()
};

struct GstEventCsvEncClass {
  GstEventEncoderClass parent_class;
};

}  // namespace

#define GST_CSV_ENC(object) (reinterpret_cast<GstEventCsvEnc*>(object))

#define GST_TYPE_CSV_DIALECT (gst_csv_dialect_get_type())
static GType gst_csv_dialect_get_type() {
  static const GType type = [] {
    // GObject keeps the array.
    static std::vector<GEnumValue> values;
    for (const auto& named : eventcamera::csv_dialects())
      values.push_back(
          {static_cast<gint>(values.size()), named.description.data(), named.name.data()});
    values.push_back({0, nullptr, nullptr});
    return g_enum_register_static("GstCsvDialect", values.data());
  }();
  return type;
}

G_DEFINE_TYPE(GstEventCsvEnc, gst_event_csv_enc, GST_TYPE_EVENT_ENCODER)
GST_ELEMENT_REGISTER_DEFINE(eventcsvenc, "eventcsvenc", GST_RANK_PRIMARY,
                            gst_event_csv_enc_get_type())

static void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  if (id == prop_dialect)
    GST_CSV_ENC(object)->dialect = g_value_get_enum(value);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
}

static void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  if (id == prop_dialect)
    g_value_set_enum(value, GST_CSV_ENC(object)->dialect);
  else
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
}

static std::unique_ptr<eventcamera::Encoder> create(GstEventEncoder* self,
                                                    const GstEventCameraInfo& info,
                                                    const GstCaps*) {
  const auto chosen = static_cast<std::size_t>(GST_CSV_ENC(self)->dialect.load());
  return std::make_unique<eventcamera::CsvEncoder>(
      eventcamera::csv_dialects()[chosen].dialect,
      eventcamera::SensorSize{info.width, info.height});
}

static void gst_event_csv_enc_init(GstEventCsvEnc*) {}

static void gst_event_csv_enc_class_init(GstEventCsvEncClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  g_object_class_install_property(
      object_class, prop_dialect,
      g_param_spec_enum(
          "dialect", "Dialect",
          "Columns, separators, unit of time and header; taken when the stream begins",
          GST_TYPE_CSV_DIALECT, 0,
          static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                   GST_PARAM_MUTABLE_READY)));
  GstEventEncoderClass* encoder_class = GST_EVENT_ENCODER_CLASS(klass);
  encoder_class->create = create;
  gst_event_encoder_class_add_pads(encoder_class, GST_EVENT_CAMERA_MAX_WIDTH,
                                   GST_EVENT_CAMERA_MAX_HEIGHT, "application/x-event-csv");

  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "CSV writer", "Codec/Encoder",
                                        "Writes events as lines of text", "gst-eventsim");
  gst_type_mark_as_plugin_api(GST_TYPE_CSV_DIALECT, static_cast<GstPluginAPIFlags>(0));
}
