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
 */
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>

#include "gst/filter/eventfilter.hpp"
#include "src/filter/pixel_mask.hpp"

using eventcamera::LabelledEvents;
using eventcamera::Microseconds;
using eventcamera::PixelMask;
using eventcamera::SensorSize;

namespace {

struct Settings {
  std::string location;
};

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

PixelMask read_mask(const std::string& location, SensorSize sensor) {
  const std::unique_ptr<std::FILE, CloseFile> file(std::fopen(location.c_str(), "rb"));
  const auto fail = [&](const char* cause) {
    throw std::runtime_error("cannot read the mask \"" + location + "\": " + cause);
  };
  if (!file) fail(std::strerror(errno));
  try {
    return PixelMask::read_png(file.get(), sensor);
  } catch (const std::runtime_error& error) {
    fail(error.what());
    throw;
  }
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
  void forget() override {}

  Guarded<Settings> settings;

 private:
  std::optional<PixelMask> mask_;
};

}  // namespace

DEFINE_EVENT_FILTER(GstEventMask, gst_event_mask, EVENT_MASK, Mask, eventmask)

static void gst_event_mask_class_init(GstEventMaskClass* klass) {
  Properties<settings_of> properties(G_OBJECT_CLASS(klass));
  properties.add(
      &Settings::location,
      g_param_spec_string("location", "Location",
                          "PNG picture of the sensor's size, read when a stream begins; "
                          "black pixels are dropped",
                          nullptr,
                          static_cast<GParamFlags>(G_PARAM_READWRITE | G_PARAM_STATIC_STRINGS |
                                                   GST_PARAM_MUTABLE_READY)));
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Event mask", "Filter",
                                        "Drops the events of masked pixels", EVENTSIM_AUTHORS);
}
