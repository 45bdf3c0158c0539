// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventscale
 * @title: eventscale
 * @short_description: scales the sensor
 *
 * Scales the sensor to the size in the caps downstream, like videoscale: events move to the output
 * pixel that contains theirs. Events of one polarity on one output pixel in one microsecond become
 * one. Without a size downstream, events pass unchanged; with only a width or height, the other
 * follows.
 *
 * An output pixel gets the events of several pixels, so its event rate rises as the size falls.
 * With #GstEventScale:min-events it fires only at every n-th event of a polarity; set that to the
 * number of input pixels per output pixel to keep the rate per pixel.
 *
 * A flush resets these counts, as does time that goes back.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventscale min-events=4 !
 * application/x-event-camera,width=320,height=240 ! eventrender ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include <cmath>

#include "gst/base/element_type.hpp"
#include "gst/base/owned.hpp"
#include "gst/base/properties.hpp"
#include "gst/eventcamera/eventcamera.h"
#include "gst/filter/changed_caps.hpp"
#include "gst/filter/eventfilter.hpp"
#include "src/filter/scale_filter.hpp"

using namespace eventcamera;
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

/// Fixates the side `first` nearest to the input, then `second` nearest to the same aspect ratio.
/// Returns the change of the aspect ratio as a factor of at least 1.
static double choose_size(GstStructure* to, const char* first, int from_first, const char* second,
                          int from_second) {
  int chosen_first = 0;
  int chosen_second = 0;
  gst_structure_fixate_field_nearest_int(to, first, from_first);
  gst_structure_get_int(to, first, &chosen_first);
  const double scale = static_cast<double>(chosen_first) / from_first;
  gst_structure_fixate_field_nearest_int(to, second,
                                         static_cast<int>(std::lround(from_second * scale)));
  gst_structure_get_int(to, second, &chosen_second);
  const double stretch = chosen_second / (from_second * scale);
  return std::max(stretch, 1 / stretch);
}

/// Fixates width and height as near to the input as the aspect ratio allows.
static GstCaps* fixate_caps(GstBaseTransform*, GstPadDirection, GstCaps* caps, GstCaps* othercaps) {
  othercaps = gst_caps_make_writable(gst_caps_truncate(othercaps));
  GstStructure* to = gst_caps_get_structure(othercaps, 0);
  GstEventCameraInfo from;
  if (!gst_event_camera_info_from_caps(&from, caps)) return gst_caps_fixate(othercaps);
  const OwnedCaps by_height(gst_caps_copy(othercaps));
  GstStructure* other = gst_caps_get_structure(by_height.get(), 0);
  if (choose_size(to, "width", from.width, "height", from.height) >
      choose_size(other, "height", from.height, "width", from.width))
    gst_caps_replace(&othercaps, by_height.get());
  return gst_caps_fixate(othercaps);
}

static void gst_event_scale_class_init(GstEventScaleClass* klass) {
  Properties<gst_event_scale_settings> properties(G_OBJECT_CLASS(klass));
  properties.add(&Settings::min_events, "min-events",
                 "Number of events of a polarity per event of an output pixel, which fires at the "
                 "time of the last one (events)",
                 1, ScaleFilter::max_min_events);
  set_metadata(klass, "Event scaler", "Filter", "Scales the sensor");
  GstBaseTransformClass* transform_class = GST_BASE_TRANSFORM_CLASS(klass);
  transform_class->transform_caps = transform_caps;
  transform_class->fixate_caps = fixate_caps;
}
