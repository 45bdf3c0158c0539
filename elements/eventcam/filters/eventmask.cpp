// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventmask
 * @title: eventmask
 * @short_description: drops the events of masked pixels
 *
 * Drops the events of the pixels that are black, or darker than mid-grey, in a PNG picture of the
 * sensor's size. Without a picture all events pass.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventmask location=mask.png !
 * eventrender ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "gst/base/element_type.hpp"
#include "gst/base/named_file.hpp"
#include "gst/base/properties.hpp"
#include "gst/filter/eventfilter.hpp"
#include "src/filter/pixel_mask.hpp"

using namespace eventcamera;

namespace {

struct Settings {
  std::string location;
};

/// Maximum size of a picture, bytes.
constexpr std::size_t max_file_size = std::size_t{64} << 20;

PixelMask read_mask(const std::string& location, SensorSize sensor) {
  return read_named_file("the mask", location, max_file_size,
                         [&](const std::string& png) { return PixelMask::parse_png(png, sensor); });
}

class Mask final : public EventFilter {
 public:
  void start(SensorSize in, SensorSize /*out*/) override {
    mask_.reset();
    if (const auto location = settings.copy().location; !location.empty())
      mask_ = read_mask(location, in);
  }
  void stop() override { mask_.reset(); }
  LabelledEvents filter(LabelledEvents events, Microseconds /*start*/) override {
    return mask_ ? mask_->filter(events) : events;
  }

  Guarded<Settings> settings;

 private:
  std::optional<PixelMask> mask_;
};

}  // namespace

DEFINE_EVENT_FILTER(GstEventMask, gst_event_mask, EVENT_MASK, Mask, eventmask)

static void gst_event_mask_class_init(GstEventMaskClass* klass) {
  Properties<gst_event_mask_settings> properties(G_OBJECT_CLASS(klass));
  properties.add_fixed(
      &Settings::location, "location",
      "PNG picture of the sensor's size, read when a stream begins; black pixels are dropped");
  set_metadata(klass, "Event mask", "Filter", "Drops the events of masked pixels");
}
