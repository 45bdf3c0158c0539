// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventscale
 * @title: eventscale
 * @short_description: scales the sensor
 *
 * Scales the sensor to the size in the caps downstream, like videoscale: events move to the pixel
 * of the output that theirs is part of. Those of one polarity that fall on one pixel in one
 * microsecond become one. Without a size downstream, events pass unchanged; with a width or height
 * only, the other follows.
 *
 * A pixel of the output sees the events of several pixels, so the event rate of each rises as the
 * size falls. With #GstEventScale:min-events it fires only once in so many events of a polarity:
 * the number of pixels that become one keeps the rate of pixels as it was.
 *
 * What is counted is forgotten after a flush and where time goes back.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventscale min-events=4 !
 * application/x-event-camera,width=320,height=240 ! eventrender ! videoconvert ! autovideosink
 * ]|
 */
#include "gst/eventcamera/eventcamera.h"
#include "gst/filter/changed_caps.hpp"
#include "gst/filter/eventfilter.hpp"
#include "src/filter/scale_filter.hpp"

using eventcamera::ScaleFilter;
using Settings = ScaleFilter::Settings;

DEFINE_EVENT_FILTER(GstEventScale, gst_event_scale, EVENT_SCALE, EventFilterOf<ScaleFilter>,
                    eventscale)

static GstCaps* transform_caps(GstBaseTransform*, GstPadDirection, GstCaps* caps, GstCaps* filter) {
  GstCaps* scaled = changed_caps(caps, nullptr, [](GstStructure* structure) {
    set_any_side(structure, "width");
    set_any_side(structure, "height");
    return true;
  });
  // The size itself first: it is preferred.
  scaled = gst_caps_merge(gst_caps_ref(caps), scaled);
  if (filter == nullptr) return scaled;
  GstCaps* limited = gst_caps_intersect_full(scaled, filter, GST_CAPS_INTERSECT_FIRST);
  gst_caps_unref(scaled);
  return limited;
}

/// Chooses the size that is nearest to that of the other side, or of its shape.
static GstCaps* fixate_caps(GstBaseTransform*, GstPadDirection, GstCaps* caps, GstCaps* othercaps) {
  othercaps = gst_caps_make_writable(gst_caps_truncate(othercaps));
  GstStructure* to = gst_caps_get_structure(othercaps, 0);
  GstEventCameraInfo from;
  if (!gst_event_camera_info_from_caps(&from, caps)) return gst_caps_fixate(othercaps);
  const auto scaled = [](int side, int scale, int by) {
    return static_cast<int>(gst_util_uint64_scale_int_round(static_cast<guint64>(side), scale, by));
  };
  int width = from.width;
  int height = from.height;
  if (gst_structure_get_int(to, "width", &width))
    height = scaled(from.height, width, from.width);
  else if (gst_structure_get_int(to, "height", &height))
    width = scaled(from.width, height, from.height);
  gst_structure_fixate_field_nearest_int(to, "width", width);
  gst_structure_fixate_field_nearest_int(to, "height", height);
  return gst_caps_fixate(othercaps);
}

static void gst_event_scale_class_init(GstEventScaleClass* klass) {
  Properties<settings_of> properties(G_OBJECT_CLASS(klass));
  properties.add(&Settings::min_events,
                 g_param_spec_uint("min-events", "Minimum events",
                                   "Number of events of a polarity at a pixel of the output for "
                                   "which it fires once, at the time of the last one (events)",
                                   1, ScaleFilter::max_min_events, Settings().min_events,
                                   mutable_playing_flags));
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Event scaler", "Filter",
                                        "Scales the sensor", EVENTSIM_AUTHORS);
  GstBaseTransformClass* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->transform_caps = transform_caps;
  transform_class->fixate_caps = fixate_caps;
}
