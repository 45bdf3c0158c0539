// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventcrop
 * @title: eventcrop
 * @short_description: cuts a region out of the sensor
 *
 * Keeps the events of a region, whose top left pixel becomes (0, 0), and changes the sensor's size
 * in the caps, like videocrop. The properties say how much is cut off at each side.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventcrop left=100 top=50 ! eventrender
 * ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include <stdexcept>

#include "gst/base/element_type.hpp"
#include "gst/base/properties.hpp"
#include "gst/filter/changed_caps.hpp"
#include "gst/filter/eventfilter.hpp"
#include "src/filter/crop_filter.hpp"

using namespace eventcamera;
using Settings = CropFilter::Settings;

namespace {

/// Columns and rows that are cut off.
int cut_columns(const Settings& settings) {
  return static_cast<int>(settings.left + settings.right);
}
int cut_rows(const Settings& settings) {
  return static_cast<int>(settings.top + settings.bottom);
}

class Crop final : public EventFilterOf<CropFilter> {
 public:
  void start(SensorSize in, SensorSize out) override {
    const Settings now = settings.copy();
    if (cut_columns(now) >= in.width || cut_rows(now) >= in.height)
      throw std::runtime_error("cropping " + std::to_string(cut_columns(now)) + " columns and " +
                               std::to_string(cut_rows(now)) + " rows leaves nothing of " +
                               in_pixels(in));
    EventFilterOf::start(in, out);
  }
};

}  // namespace

DEFINE_EVENT_FILTER(GstEventCrop, gst_event_crop, EVENT_CROP, Crop, eventcrop)

static GstCaps* transform_caps(GstBaseTransform* transform, GstPadDirection direction,
                               GstCaps* caps, GstCaps* filter) {
  const Settings settings = gst_event_crop_settings(G_OBJECT(transform)).copy();
  const int sign = direction == GST_PAD_SINK ? -1 : 1;
  return changed_caps(caps, filter, [&](GstStructure* structure) {
    return change_side(structure, "width", sign * cut_columns(settings)) &&
           change_side(structure, "height", sign * cut_rows(settings));
  });
}

static void gst_event_crop_class_init(GstEventCropClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  Properties<gst_event_crop_settings> properties(object_class);
  const auto add = [&](auto field, const char* name, const char* blurb) {
    properties.add(field, name, blurb, 0, max_side);
  };
  add(&Settings::left, "left", "Columns to cut off at the left (pixels)");
  add(&Settings::right, "right", "Columns to cut off at the right (pixels)");
  add(&Settings::top, "top", "Rows to cut off at the top (pixels)");
  add(&Settings::bottom, "bottom", "Rows to cut off at the bottom (pixels)");
  object_class->notify = [](GObject* object, GParamSpec*) {
    gst_base_transform_reconfigure_src(GST_BASE_TRANSFORM(object));
  };
  set_metadata(klass, "Event crop", "Filter", "Cuts a region out of the sensor");
  GST_BASE_TRANSFORM_CLASS(klass)->transform_caps = transform_caps;
}
