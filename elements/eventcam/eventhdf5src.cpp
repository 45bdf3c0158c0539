// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventhdf5src
 * @title: eventhdf5src
 * @short_description: reads an HDF5 file of events
 *
 * filesrc and eventhdf5dec in one.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 eventhdf5src location=events.h5 ! evtenc ! filesink location=events.raw
 * ]|
 */
#include "gst/base/file_streams.hpp"
#include "gst/base/reading_properties.hpp"

namespace {

enum Property : guint { prop_location = 1, prop_buffer_time, prop_stats };

struct GstEventHdf5Src {
  GstBin parent;
  GstElement* file;  ///< the bin's, as is the decoder; neither where GStreamer lacks filesrc
  GstElement* decoder;
  GstPad* src;
};

struct GstEventHdf5SrcClass {
  GstBinClass parent_class;
};

}  // namespace

G_DEFINE_TYPE(GstEventHdf5Src, gst_event_hdf5_src, GST_TYPE_BIN)
GST_ELEMENT_REGISTER_DEFINE(eventhdf5src, "eventhdf5src", GST_RANK_NONE,
                            gst_event_hdf5_src_get_type())

static GstEventHdf5Src* src_of(gpointer object) {
  return reinterpret_cast<GstEventHdf5Src*>(object);
}

static GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(FILE_EVENTS_CAPS));

/// The element inside that has a property.
static GstElement* owner_of(GstEventHdf5Src* self, guint id) {
  return id == prop_location ? self->file : self->decoder;
}

static void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  if (GstElement* owner = owner_of(src_of(object), id))
    g_object_set_property(G_OBJECT(owner), spec->name, value);
}

static void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  if (GstElement* owner = owner_of(src_of(object), id))
    g_object_get_property(G_OBJECT(owner), spec->name, value);
}

/// The reader's pad comes with its first output.
static void show_pad(GstElement*, GstPad* pad, GstEventHdf5Src* self) {
  gst_ghost_pad_set_target(GST_GHOST_PAD(self->src), pad);
}

static GstStateChangeReturn change_state(GstElement* element, GstStateChange transition) {
  if (src_of(element)->decoder == nullptr) {
    GST_ELEMENT_ERROR(element, CORE, MISSING_PLUGIN, ("There is no element filesrc."), (nullptr));
    return GST_STATE_CHANGE_FAILURE;
  }
  return GST_ELEMENT_CLASS(gst_event_hdf5_src_parent_class)->change_state(element, transition);
}

static void gst_event_hdf5_src_init(GstEventHdf5Src* self) {
  GST_OBJECT_FLAG_SET(self, GST_ELEMENT_FLAG_SOURCE);
  GstPadTemplate* const templ = gst_static_pad_template_get(&src_template);
  self->src = gst_ghost_pad_new_no_target_from_template("src", templ);
  gst_object_unref(templ);
  gst_element_add_pad(GST_ELEMENT(self), self->src);
  self->file = gst_element_factory_make("filesrc", nullptr);
  self->decoder = gst_element_factory_make("eventhdf5dec", nullptr);
  if (self->file == nullptr || self->decoder == nullptr) {
    gst_clear_object(&self->file);
    gst_clear_object(&self->decoder);
    return;
  }
  gst_bin_add_many(GST_BIN(self), self->file, self->decoder, nullptr);
  gst_element_link(self->file, self->decoder);
  g_signal_connect(self->decoder, "pad-added", G_CALLBACK(show_pad), self);
}

static void gst_event_hdf5_src_class_init(GstEventHdf5SrcClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = set_property;
  object_class->get_property = get_property;
  const auto flags = static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                              GST_PARAM_MUTABLE_READY);
  g_object_class_install_property(
      object_class, prop_location,
      g_param_spec_string("location", "Location", "The file to read", nullptr, flags));
  g_object_class_install_property(object_class, prop_buffer_time, buffer_time_spec());
  g_object_class_install_property(object_class, prop_stats, reading_stats_spec());

  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  element_class->change_state = change_state;
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_set_static_metadata(element_class, "HDF5 file source", "Source/File",
                                        "Reads HDF5 files of events: DSEC, Metavision, v2e",
                                        "gst-eventsim");
}
