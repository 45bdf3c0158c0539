// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-aedatdemux
 * @title: aedatdemux
 * @short_description: reads AEDAT, the files of DAVIS and DVS cameras
 *
 * Takes an AEDAT 4 file apart into its event streams and its frames. AEDAT 2.0 and 3.1 are read as
 * one event stream. Triggers and IMU samples are counted and left out.
 *
 * PTS are the file's own times, so that nothing is lost where they are written again. The segments
 * of all streams start at one zero, the first thing that any of them has, so that playback starts
 * at once, and events and frames are in sync. A file with times before 0 is moved to begin at 0.
 *
 * A file is pulled where upstream can, as filesrc does: then one can seek in it, by the table at
 * its end where it has one, and the table tells the duration; without one the duration is exact for
 * files of up to 16 MiB, and estimated for longer ones until their end was read. A stream of bytes
 * is played as it comes.
 *
 * Of broken input, what is whole is delivered; the first place that is not is reported as a
 * warning, and `stats` counts them.
 *
 * A stream that has no frame or event in the first second gets its pad when the first one comes.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=davis.aedat4 ! aedatdemux name=d  d.events_0 ! queue !
 * eventrender ! videoconvert ! autovideosink  d.video_0 ! queue ! videoconvert ! autovideosink
 * ]|
 */
#include <mutex>

#include "elements/eventcam/aedatdemux/pads.hpp"
#include "elements/eventcam/aedatdemux/pulled.hpp"
#include "elements/eventcam/aedatdemux/pushed.hpp"
#include "elements/eventcam/aedatdemux/state.hpp"
#include "elements/eventcam/aedatdemux/statistics.hpp"
#include "gst/base/pulling.hpp"
#include "gst/base/reading_properties.hpp"

GST_DEBUG_CATEGORY(aedat_demux_debug);

namespace {

enum Property : guint { prop_buffer_time = 1, prop_stats };

}  // namespace

G_DEFINE_TYPE_WITH_CODE(GstAedatDemux, gst_aedat_demux, GST_TYPE_ELEMENT,
                        GST_DEBUG_CATEGORY_INIT(aedat_demux_debug, "aedatdemux", 0,
                                                "AEDAT demuxer"))
GST_ELEMENT_REGISTER_DEFINE(aedatdemux, "aedatdemux", GST_RANK_PRIMARY, gst_aedat_demux_get_type())

static GstStaticPadTemplate sink_template =
    GST_STATIC_PAD_TEMPLATE("sink", GST_PAD_SINK, GST_PAD_ALWAYS,
                            GST_STATIC_CAPS("application/x-aedat, version = (int) { 2, 3, 4 }"));

/* properties */

static void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  auto* priv = aedatdemux::demux_of(object)->priv;
  if (id == prop_buffer_time) {
    const std::lock_guard lock(priv->mutex);
    priv->buffer_time = g_value_get_uint64(value);
  } else {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
  }
}

static void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  auto* priv = aedatdemux::demux_of(object)->priv;
  if (id == prop_buffer_time) {
    const std::lock_guard lock(priv->mutex);
    g_value_set_uint64(value, priv->buffer_time);
  } else if (id == prop_stats) {
    g_value_take_boxed(value, aedatdemux::make_stats(aedatdemux::demux_of(object)));
  } else {
    G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
  }
}

/* states */

static void remove_pads(GstAedatDemux* self) {
  for (auto& stream : self->priv->state.streams) {
    if (stream.pad == nullptr) continue;
    gst_flow_combiner_remove_pad(self->priv->combiner, stream.pad);
    gst_element_remove_pad(GST_ELEMENT(self), stream.pad);
  }
}

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  auto* self = aedatdemux::demux_of(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED) aedatdemux::reset(self);
  const auto result =
      GST_ELEMENT_CLASS(gst_aedat_demux_parent_class)->change_state(element, transition);
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) {
    remove_pads(self);
    aedatdemux::reset(self);
  }
  return result;
}

/* type */

static void finalize(GObject* object) {
  auto* priv = aedatdemux::demux_of(object)->priv;
  gst_flow_combiner_free(priv->combiner);
  delete priv;
  G_OBJECT_CLASS(gst_aedat_demux_parent_class)->finalize(object);
}

static void gst_aedat_demux_init(GstAedatDemux* self) {
  self->priv = new GstAedatDemuxPrivate(GST_ELEMENT(self));
  self->priv->combiner = gst_flow_combiner_new();
  self->priv->sink = gst_pad_new_from_static_template(&sink_template, "sink");
  gst_pad_set_activate_function(self->priv->sink, activate_pulling);
  gst_pad_set_activatemode_function(self->priv->sink, aedatdemux::activate_mode);
  gst_pad_set_chain_function(self->priv->sink, aedatdemux::chain);
  gst_pad_set_event_function(self->priv->sink, aedatdemux::sink_event);
  gst_element_add_pad(GST_ELEMENT(self), self->priv->sink);
}

static void gst_aedat_demux_class_init(GstAedatDemuxClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  object_class->finalize = finalize;
  g_object_class_install_property(object_class, prop_buffer_time, buffer_time_spec());
  g_object_class_install_property(
      object_class, prop_stats,
      g_param_spec_boxed(
          "stats", "Statistics", "What was read, and what was corrupt or left out, since the start",
          GST_TYPE_STRUCTURE, static_cast<GParamFlags>(G_PARAM_READABLE | G_PARAM_STATIC_STRINGS)));

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = change_state;
  gst_element_class_add_static_pad_template(element_class, &sink_template);
  aedatdemux::add_pad_templates(element_class);
  gst_element_class_set_static_metadata(element_class, "AEDAT demuxer", "Codec/Demuxer",
                                        "Reads events and frames from AEDAT files", "gst-eventsim");
}
