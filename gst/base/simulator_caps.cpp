// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/base/simulator_caps.hpp"

#include <initializer_list>

#include "gst/base/drawn_video.hpp"
#include "gst/eventcamera/eventcamera.h"

namespace {

/// Returns a structure `name` with a copy of these `fields`, as far as `from` has them.
GstStructure* with_fields_of(const GstStructure* from, const char* name,
                             std::initializer_list<const char*> fields) {
  GstStructure* to = gst_structure_new_empty(name);
  for (const char* field : fields)
    if (const GValue* value = gst_structure_get_value(from, field))
      gst_structure_set_value(to, field, value);
  return to;
}

void set_formats(GstStructure* structure, const char* formats) {
  GValue list = G_VALUE_INIT;
  g_value_init(&list, GST_TYPE_LIST);
  gst_value_deserialize(&list, formats);
  gst_structure_take_value(structure, "format", &list);
}

}  // namespace

GstCaps* event_simulator_output_caps(const GstCaps* video) {
  GstCaps* output = gst_caps_new_empty();
  for (guint i = 0; i < gst_caps_get_size(video); ++i) {
    const GstStructure* in = gst_caps_get_structure(video, i);
    GstStructure* events =
        with_fields_of(in, GST_EVENT_CAMERA_MEDIA_TYPE, {"width", "height", "framerate"});
    gst_structure_set(events, "format", G_TYPE_STRING, "XYTP", nullptr);
    output = gst_caps_merge_structure(output, events);
  }
  for (guint i = 0; i < gst_caps_get_size(video); ++i) {
    const GstStructure* in = gst_caps_get_structure(video, i);
    GstStructure* pictures =
        with_fields_of(in, "video/x-raw", {"width", "height", "framerate", "pixel-aspect-ratio"});
    if (gst_caps_is_fixed(video) && !gst_structure_has_field(pictures, "pixel-aspect-ratio"))
      gst_structure_set(pictures, "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1, nullptr);
    set_formats(pictures, DRAWN_VIDEO_FORMATS);
    output = gst_caps_merge_structure(output, pictures);
  }
  return output;
}

GstCaps* event_simulator_input_caps(const GstCaps* output) {
  GstCaps* video = gst_caps_new_empty();
  for (guint i = 0; i < gst_caps_get_size(output); ++i) {
    const GstStructure* out = gst_caps_get_structure(output, i);
    GstStructure* in =
        with_fields_of(out, "video/x-raw", {"width", "height", "framerate", "pixel-aspect-ratio"});
    set_formats(in, EVENT_SIMULATOR_INPUT_FORMATS);
    video = gst_caps_merge_structure(video, in);
  }
  return video;
}

GstCaps* event_simulator_fixate_output(GstCaps* caps) {
  guint chosen = 0;
  for (guint i = gst_caps_get_size(caps); i-- > 0;)
    if (gst_structure_has_name(gst_caps_get_structure(caps, i), GST_EVENT_CAMERA_MEDIA_TYPE))
      chosen = i;
  GstCaps* fixed = gst_caps_copy_nth(caps, chosen);
  gst_caps_unref(caps);
  return gst_caps_fixate(fixed);
}

bool event_simulator_draws(const GstCaps* output) {
  return !gst_structure_has_name(gst_caps_get_structure(output, 0), GST_EVENT_CAMERA_MEDIA_TYPE);
}
