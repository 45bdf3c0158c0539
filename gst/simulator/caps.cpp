// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/caps.hpp"

#include <initializer_list>

#include "gst/base/event_buffer.hpp"
#include "gst/base/pads.hpp"

namespace {

/// Returns a structure `name` with copies of the `fields` that `from` has.
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

/// Video of `formats` with the geometry of `caps`.
GstCaps* SimulatorVideo::video_of(const GstCaps* caps, const char* of_formats) const {
  GstCaps* video = gst_caps_new_empty();
  for (guint i = 0; i < gst_caps_get_size(caps); ++i) {
    GstStructure* structure =
        with_fields_of(gst_caps_get_structure(caps, i), "video/x-raw",
                       {"width", "height", "framerate", "pixel-aspect-ratio"});
    set_formats(structure, of_formats);
    if (texture_target != nullptr)
      gst_structure_set(structure, "texture-target", G_TYPE_STRING, texture_target, nullptr);
    video = gst_caps_merge_structure_full(video, structure, gst_caps_features_new(memory, nullptr));
  }
  return video;
}

GstCaps* SimulatorVideo::output_caps(const GstCaps* input) const {
  GstCaps* output = gst_caps_new_empty();
  for (guint i = 0; i < gst_caps_get_size(input); ++i) {
    GstStructure* events =
        with_fields_of(gst_caps_get_structure(input, i), GST_EVENT_CAMERA_MEDIA_TYPE,
                       {"width", "height", "framerate"});
    gst_structure_set(events, "format", G_TYPE_STRING, "XYTP", nullptr);
    output = gst_caps_merge_structure(output, events);
  }
  if (drawn_formats == nullptr) return output;
  GstCaps* pictures = video_of(input, drawn_formats);
  if (gst_caps_is_fixed(input)) {
    GstStructure* picture = gst_caps_get_structure(pictures, 0);
    if (!gst_structure_has_field(picture, "pixel-aspect-ratio"))
      gst_structure_set(picture, "pixel-aspect-ratio", GST_TYPE_FRACTION, 1, 1, nullptr);
  }
  return gst_caps_merge(output, pictures);
}

GstCaps* SimulatorVideo::input_caps(const GstCaps* output) const {
  GstCaps* input = video_of(output, formats);
  if (texture_target == nullptr) return input;
  const SimulatorVideo uploaded{GST_CAPS_FEATURE_MEMORY_SYSTEM_MEMORY, formats, nullptr};
  return gst_caps_merge(input, uploaded.input_caps(output));
}

void SimulatorVideo::install_pads(GstElementClass* klass) const {
  const OwnedCaps any(gst_caps_from_string(GST_EVENT_CAMERA_MEDIA_TYPE
                                           ", " SIZE_CAPS ", framerate = (fraction) [ 0, max ]"));
  add_pad_template(klass, "sink", GST_PAD_SINK, OwnedCaps(input_caps(any.get())));
  add_pad_template(klass, "src", GST_PAD_SRC, OwnedCaps(output_caps(any.get())));
}

bool event_simulator_draws(const GstCaps* output) {
  return !gst_structure_has_name(gst_caps_get_structure(output, 0), GST_EVENT_CAMERA_MEDIA_TYPE);
}
