// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/eventrender/properties.hpp"

#include <limits>
#include <mutex>

#include "elements/eventcam/eventrender/state.hpp"

namespace eventrender {

using eventcamera::RenderMode;

namespace {

enum Property {
  prop_0,
  prop_mode,
  prop_palette,
  prop_accumulation_time,
  prop_event_count,
  prop_area_event_count,
  prop_area_size,
  prop_full_scale,
};

}  // namespace

static GType gst_event_render_mode_get_type() {
  static const GType type = [] {
    static const GEnumValue values[] = {
        {static_cast<gint>(RenderMode::accumulate), "Which polarities fired within a window",
         "accumulate"},
        {static_cast<gint>(RenderMode::decay), "The sum of ON minus OFF, fading exponentially",
         "decay"},
        {static_cast<gint>(RenderMode::time_surface),
         "How long ago the last event was, by its polarity", "time-surface"},
        {static_cast<gint>(RenderMode::count), "ON minus OFF within a window", "count"},
        {0, nullptr, nullptr},
    };
    return g_enum_register_static("GstEventRenderMode", values);
  }();
  return type;
}

static void set_property(GObject* object, guint id, const GValue* value, GParamSpec* spec) {
  auto& priv = *event_render(object)->priv;
  const std::lock_guard lock(priv.mutex);
  auto& settings = priv.settings;
  switch (id) {
    case prop_mode:
      settings.mode = static_cast<RenderMode>(g_value_get_enum(value));
      break;
    case prop_palette:
      settings.palette = static_cast<GstEventCameraPalette>(g_value_get_enum(value));
      break;
    case prop_accumulation_time:
      settings.accumulation_time = g_value_get_uint64(value);
      break;
    case prop_event_count:
      settings.event_count = g_value_get_uint(value);
      break;
    case prop_area_event_count:
      settings.area_event_count = g_value_get_uint(value);
      break;
    case prop_area_size:
      settings.area_size = g_value_get_uint(value);
      break;
    case prop_full_scale:
      settings.full_scale = g_value_get_double(value);
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
      break;
  }
}

static void get_property(GObject* object, guint id, GValue* value, GParamSpec* spec) {
  auto& priv = *event_render(object)->priv;
  const std::lock_guard lock(priv.mutex);
  const auto& settings = priv.settings;
  switch (id) {
    case prop_mode:
      g_value_set_enum(value, static_cast<gint>(settings.mode));
      break;
    case prop_palette:
      g_value_set_enum(value, settings.palette);
      break;
    case prop_accumulation_time:
      g_value_set_uint64(value, settings.accumulation_time);
      break;
    case prop_event_count:
      g_value_set_uint(value, settings.event_count);
      break;
    case prop_area_event_count:
      g_value_set_uint(value, settings.area_event_count);
      break;
    case prop_area_size:
      g_value_set_uint(value, settings.area_size);
      break;
    case prop_full_scale:
      g_value_set_double(value, settings.full_scale);
      break;
    default:
      G_OBJECT_WARN_INVALID_PROPERTY_ID(object, id, spec);
      break;
  }
}

void install_properties(GObjectClass* object_class) {
  object_class->set_property = set_property;
  object_class->get_property = get_property;

  constexpr auto flags = static_cast<GParamFlags>(
      G_PARAM_READWRITE | G_PARAM_CONSTRUCT | G_PARAM_STATIC_STRINGS | GST_PARAM_MUTABLE_PLAYING);
  const Settings defaults;
  g_object_class_install_property(
      object_class, prop_mode,
      g_param_spec_enum("mode", "Mode", "What a picture shows", gst_event_render_mode_get_type(),
                        static_cast<gint>(defaults.mode), flags));
  g_object_class_install_property(
      object_class, prop_palette,
      g_param_spec_enum("palette", "Palette",
                        "The colours; those of viridis and magma show how much, whichever polarity",
                        GST_TYPE_EVENT_CAMERA_PALETTE, defaults.palette, flags));
  g_object_class_install_property(
      object_class, prop_accumulation_time,
      g_param_spec_uint64(
          "accumulation-time", "Accumulation time",
          "How long the window of accumulate and count is, the time in which decay fades to 1/e, "
          "and how long time-surface looks back (ns; 0 = as long as a picture lasts, or as the "
          "counts allow, for accumulate and count, and 100 ms for the others)",
          0, std::numeric_limits<gint64>::max(), defaults.accumulation_time, flags));
  g_object_class_install_property(
      object_class, prop_event_count,
      g_param_spec_uint("event-count", "Event count",
                        "The most events in the window of accumulate and count (events; 0 = any)",
                        0, eventcamera::RecentEvents::most, defaults.event_count, flags));
  g_object_class_install_property(
      object_class, prop_area_event_count,
      g_param_spec_uint("area-event-count", "Area event count",
                        "The most events in any one area in the window of accumulate and count: "
                        "the busiest place decides how long it is (events; 0 = any)",
                        0, eventcamera::RecentEvents::most, defaults.area_event_count, flags));
  g_object_class_install_property(
      object_class, prop_area_size,
      g_param_spec_uint("area-size", "Area size",
                        "The side of the squares that area-event-count counts in (pixels)", 1,
                        16384, defaults.area_size, flags));
  g_object_class_install_property(
      object_class, prop_full_scale,
      g_param_spec_double("full-scale", "Full scale",
                          "How many events of a pixel have the full colour, for decay and count "
                          "(events)",
                          0.1, 1e6, defaults.full_scale, flags));
  gst_type_mark_as_plugin_api(gst_event_render_mode_get_type(), static_cast<GstPluginAPIFlags>(0));
  gst_type_mark_as_plugin_api(GST_TYPE_EVENT_CAMERA_PALETTE, static_cast<GstPluginAPIFlags>(0));
}

}  // namespace eventrender
