// SPDX-License-Identifier: LGPL-2.1-or-later
/**
 * SECTION:element-eventundistort
 * @title: eventundistort
 * @short_description: undoes the distortion of a lens
 *
 * Moves each event to the pixel where a camera without distortion would see it, with the same focal
 * length and principal point. Events that leave the picture are dropped, and counted as
 * `dropped-events` of the property `stats`.
 *
 * The calibration is a YAML file, as OpenCV's FileStorage writes it: `camera_matrix` and
 * `distortion_coefficients`, optionally `image_width`, `image_height` and `fisheye_model`; or as
 * ROS's camera_calibration writes it, with the `distortion_model` plumb_bob or equidistant. XML of
 * the same content is read, too. #GstEventUndistort:settings takes a calibration as text, such as
 * the property `settings` of GStreamer's cameracalibrate. Without a calibration all events pass.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 filesrc location=recording.raw ! evtdec ! eventundistort location=camera.yaml !
 * eventrender ! videoconvert ! autovideosink
 * ]|
 *
 * Since: 0.1
 */
#include "gst/base/element_type.hpp"
#include "gst/base/named_file.hpp"
#include "gst/base/properties.hpp"
#include "gst/filter/eventfilter.hpp"
#include "src/filter/camera_calibration.hpp"
#include "src/filter/undistort_filter.hpp"

using namespace eventcamera;

namespace {

struct Settings {
  std::string location;
  std::string calibration;  ///< instead of a file
};

/// Maximum size of a calibration file, bytes.
constexpr std::size_t max_file_size = 1 << 20;

/// Throws std::invalid_argument.
CameraCalibration calibration_of(const std::string& text, SensorSize sensor) {
  const auto calibration = parse_calibration(text);
  const auto [width, height] = calibration.size;
  const SensorSize size{width != 0 ? width : sensor.width, height != 0 ? height : sensor.height};
  if (size != sensor)
    throw std::invalid_argument("it is for " + in_pixels(size) + ", but the sensor has " +
                                in_pixels(sensor));
  return calibration;
}

class Undistort final : public EventFilter {
 public:
  void start(SensorSize in, SensorSize /*out*/) override {
    core_.reset();
    const auto [location, calibration] = settings.copy();
    const auto parse = [in](const std::string& text) { return calibration_of(text, in); };
    if (!calibration.empty()) {
      try {
        core_.emplace(in, parse(calibration));
      } catch (const std::invalid_argument& error) {
        throw std::runtime_error(std::string("cannot read the calibration in \"settings\": ") +
                                 error.what());
      }
    } else if (!location.empty()) {
      core_.emplace(in, read_named_file("the calibration", location, max_file_size, parse));
    }
  }
  void stop() override { core_.reset(); }
  LabelledEvents filter(LabelledEvents events, Microseconds /*start*/) override {
    return core_ ? core_->filter(events) : events;
  }

  Guarded<Settings> settings;

 private:
  std::optional<UndistortFilter> core_;
};

}  // namespace

DEFINE_EVENT_FILTER(GstEventUndistort, gst_event_undistort, EVENT_UNDISTORT, Undistort,
                    eventundistort)

static void gst_event_undistort_class_init(GstEventUndistortClass* klass) {
  Properties<gst_event_undistort_settings> properties(G_OBJECT_CLASS(klass));
  properties.add_fixed(
      &Settings::location, "location",
      "YAML or XML file with the calibration of the camera, read when a stream begins");
  properties.add_fixed(&Settings::calibration, "settings",
                       "Calibration of the camera as YAML or XML text, such as the property "
                       "`settings` of cameracalibrate; instead of location");
  set_metadata(klass, "Event undistortion", "Filter", "Undoes the distortion of a lens");
}
