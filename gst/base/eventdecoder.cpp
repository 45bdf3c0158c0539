// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/eventdecoder.hpp"

#include <mutex>

#include "gst/base/eventdecoder/pulled.hpp"
#include "gst/base/eventdecoder/pushed.hpp"
#include "gst/base/eventdecoder/queries.hpp"
#include "gst/base/eventdecoder/seeking.hpp"
#include "gst/base/eventdecoder/state.hpp"
#include "gst/base/eventdecoder/statistics.hpp"
#include "gst/base/file_streams.hpp"
#include "gst/base/pulling.hpp"
#include "gst/base/reading_properties.hpp"

GST_DEBUG_CATEGORY(event_decoder_debug);

namespace {

enum Property : guint { prop_buffer_time = 1, prop_stats };

}  // namespace

G_DEFINE_ABSTRACT_TYPE_WITH_CODE(GstEventDecoder, gst_event_decoder, GST_TYPE_ELEMENT,
                                 GST_DEBUG_CATEGORY_INIT(event_decoder_debug, "eventdecoder", 0,
                                                         "readers of event files"))

/* properties */

static void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  auto* priv = GST_EVENT_DECODER(object)->priv;
  if (id == prop_buffer_time) {
    const std::lock_guard lock(priv->mutex);
    priv->buffer_time = g_value_get_uint64(value);
  } else {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
  }
}

static void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  auto* priv = GST_EVENT_DECODER(object)->priv;
  if (id == prop_buffer_time) {
    const std::lock_guard lock(priv->mutex);
    g_value_set_uint64(value, priv->buffer_time);
  } else if (id == prop_stats) {
    g_value_take_boxed(value, eventdecoder::make_stats(GST_EVENT_DECODER(object)));
  } else {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
  }
}

/* states */

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  const GstStateChangeReturn result =
      GST_ELEMENT_CLASS(gst_event_decoder_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY)
    eventdecoder::reset(GST_EVENT_DECODER(element));
  return result;
}

/* type */

void gst_event_decoder_class_add_pads(GstEventDecoderClass* klass, const char* sink_caps) {
  const OwnedCaps in(gst_caps_from_string(sink_caps));
  const OwnedCaps out(gst_caps_from_string(FILE_EVENTS_CAPS));
  auto* element_class = GST_ELEMENT_CLASS(klass);
  gst_element_class_add_pad_template(
      element_class, gst_pad_template_new("sink", GST_PAD_SINK, GST_PAD_ALWAYS, in.get()));
  gst_element_class_add_pad_template(
      element_class, gst_pad_template_new("src", GST_PAD_SRC, GST_PAD_SOMETIMES, out.get()));
}

/// The pads are those of the subclass, which is not yet known in init.
static void constructed(GObject* object) {
  auto* element = GST_ELEMENT(object);
  auto* priv = GST_EVENT_DECODER(object)->priv;
  auto* element_class = GST_ELEMENT_GET_CLASS(element);
  priv->sink =
      gst_pad_new_from_template(gst_element_class_get_pad_template(element_class, "sink"), "sink");
  gst_pad_set_activate_function(priv->sink, activate_pulling);
  gst_pad_set_activatemode_function(priv->sink, eventdecoder::activate_mode);
  gst_pad_set_chain_function(priv->sink, eventdecoder::chain);
  gst_pad_set_event_function(priv->sink, eventdecoder::sink_event);
  gst_element_add_pad(element, priv->sink);
  priv->src =
      gst_pad_new_from_template(gst_element_class_get_pad_template(element_class, "src"), "src");
  gst_pad_set_event_function(priv->src, eventdecoder::src_event);
  gst_pad_set_query_function(priv->src, eventdecoder::src_query);
  gst_pad_use_fixed_caps(priv->src);
  gst_object_ref_sink(priv->src);
  G_OBJECT_CLASS(gst_event_decoder_parent_class)->constructed(object);
}

static void finalize(GObject* object) {
  auto* self = GST_EVENT_DECODER(object);
  eventdecoder::drop_held(self);
  gst_clear_event(&self->priv->stream_start);
  gst_clear_object(&self->priv->src);
  delete self->priv;
  G_OBJECT_CLASS(gst_event_decoder_parent_class)->finalize(object);
}

static void gst_event_decoder_init(GstEventDecoder* self) {
  self->priv = new GstEventDecoderPrivate(GST_ELEMENT(self));
  gst_segment_init(&self->priv->segment, GST_FORMAT_TIME);
}

static void gst_event_decoder_class_init(GstEventDecoderClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  object_class->constructed = constructed;
  object_class->finalize = finalize;
  GST_ELEMENT_CLASS(klass)->change_state = change_state;
  g_object_class_install_property(object_class, prop_buffer_time, buffer_time_spec());
  g_object_class_install_property(object_class, prop_stats, reading_stats_spec());
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_DECODER, static_cast<GstPluginAPIFlags>(0));
}
