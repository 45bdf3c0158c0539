// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventflip
 * @title: eventflip
 * @short_description: flips and rotates the sensor
 *
 * Flips or rotates the sensor in one of eight ways, like videoflip, and changes its size in the
 * caps if columns become rows. It implements #GstVideoDirection, so applications can control it
 * like videoflip. The methods `auto` and `custom` leave events as they are.
 *
 * Events keep their order, so events of one microsecond are no longer in raster order.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventflip video-direction=90r !
 * eventrender ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include <gst/video/video.h>

#include "gst/base/element_type.hpp"
#include "gst/base/properties.hpp"
#include "gst/filter/changed_caps.hpp"
#include "gst/filter/eventfilter.hpp"
#include "src/filter/flip_filter.hpp"

using namespace eventcamera;

namespace {

Orientation orientation_of(GstVideoOrientationMethod method) {
  switch (method) {
    case GST_VIDEO_ORIENTATION_90R:
      return {.transpose = true, .mirror_x = true};
    case GST_VIDEO_ORIENTATION_180:
      return {.mirror_x = true, .mirror_y = true};
    case GST_VIDEO_ORIENTATION_90L:
      return {.transpose = true, .mirror_y = true};
    case GST_VIDEO_ORIENTATION_HORIZ:
      return {.mirror_x = true};
    case GST_VIDEO_ORIENTATION_VERT:
      return {.mirror_y = true};
    case GST_VIDEO_ORIENTATION_UL_LR:
      return {.transpose = true};
    case GST_VIDEO_ORIENTATION_UR_LL:
      return {.transpose = true, .mirror_x = true, .mirror_y = true};
    default:
      return {};
  }
}

struct Settings {
  GstVideoOrientationMethod direction = GST_VIDEO_ORIENTATION_IDENTITY;
};

class Flip final : public EventFilter {
 public:
  void start(SensorSize in, SensorSize out) override {
    in_ = in;
    out_ = out;
    orientation_ = {.transpose = in != out};
  }
  LabelledEvents filter(LabelledEvents events, Microseconds /*start*/) override {
    // A direction that changes the size applies only after the next negotiation of caps.
    const Orientation wanted = orientation_of(settings.copy().direction);
    if (wanted.size(in_) == out_) orientation_ = wanted;
    return FlipFilter(in_, orientation_).filter(events);
  }

  Guarded<Settings> settings;

 private:
  SensorSize in_;
  SensorSize out_;
  Orientation orientation_;
};

}  // namespace

DEFINE_EVENT_FILTER(GstEventFlip, gst_event_flip, EVENT_FLIP, Flip, eventflip,
                    implement(g_define_type_id, GST_TYPE_VIDEO_DIRECTION))

static GstCaps* transform_caps(GstBaseTransform* transform, GstPadDirection, GstCaps* caps,
                               GstCaps* filter) {
  const auto direction = gst_event_flip_settings(G_OBJECT(transform)).copy().direction;
  const bool transpose = orientation_of(direction).transpose;
  return changed_caps(caps, filter, [transpose](GstStructure* structure) {
    const GValue* width = gst_structure_get_value(structure, "width");
    const GValue* height = gst_structure_get_value(structure, "height");
    if (!transpose || width == nullptr || height == nullptr) return true;
    GValue rows = G_VALUE_INIT;
    g_value_init(&rows, G_VALUE_TYPE(width));
    g_value_copy(width, &rows);
    gst_structure_set_value(structure, "width", height);
    gst_structure_take_value(structure, "height", &rows);
    return true;
  });
}

static void gst_event_flip_class_init(GstEventFlipClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  Properties<gst_event_flip_settings> properties(object_class);
  // Implements the property of GstVideoDirection, which does not say that it may change at any
  // time.
  properties.add(&Settings::direction, "video-direction", "How to flip or rotate",
                 GST_TYPE_VIDEO_ORIENTATION_METHOD);
  object_class->notify = [](GObject* object, GParamSpec*) {
    gst_base_transform_reconfigure_src(GST_BASE_TRANSFORM(object));
  };
  set_metadata(klass, "Event flip", "Filter", "Flips and rotates the sensor");
  GST_BASE_TRANSFORM_CLASS(klass)->transform_caps = transform_caps;
}
