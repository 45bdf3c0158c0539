// SPDX-License-Identifier: LGPL-2.1-or-later
#include "elements/eventcam/cameras/event_camera.hpp"

#include <algorithm>
#include <iterator>

namespace eventcamera {

namespace {

struct Words {
  std::string_view name;
  EvtFormat format;
};

constexpr Words fourccs[] = {
    {"PSEE", EvtFormat::evt2},
    {"PSE1", EvtFormat::evt21_legacy},
    {"PSE2", EvtFormat::evt21},
    {"PSE3", EvtFormat::evt3},
};

/// Values of the control evt_format; ME: upper half first.
constexpr Words controls[] = {
    {"EVT2", EvtFormat::evt2},
    {"EVT21ME", EvtFormat::evt21_legacy},
    {"EVT21", EvtFormat::evt21},
    {"EVT3", EvtFormat::evt3},
};

template <std::size_t count>
std::optional<EvtFormat> format_named(std::string_view name, const Words (&words)[count]) {
  const auto* const found = std::ranges::find(words, name, &Words::name);
  return found != std::end(words) ? std::optional(found->format) : std::nullopt;
}

struct Sensor {
  std::string_view name;
  SensorSize size;
};

constexpr Sensor sensors[] = {{"imx636", {1280, 720}}, {"genx320", {320, 320}}};

/// Sensor of a media entity, whose name is followed by its bus address.
const Sensor* sensor_named(std::string_view entity) {
  const auto name = entity.substr(0, entity.find(' '));
  const auto* const found = std::ranges::find(sensors, name, &Sensor::name);
  return found != std::end(sensors) ? found : nullptr;
}

}  // namespace

std::optional<EvtFormat> words_of_fourcc(std::string_view fourcc) {
  return format_named(fourcc, fourccs);
}

std::optional<EventCamera> event_camera_of(const VideoDevice& device) {
  const auto* const sensor = sensor_named(device.sensor);
  const bool is_grey = device.fourcc == "GREY";
  const auto format =
      is_grey ? format_named(device.word_format, controls) : words_of_fourcc(device.fourcc);
  const bool is_of_prophesee = sensor != nullptr || device.driver.starts_with("psee-");
  if (is_grey ? !is_of_prophesee : !format) return std::nullopt;
  EventCamera camera{.name = "Event camera ", .format = format, .sensor = {}, .is_grey = is_grey};
  camera.name += sensor != nullptr ? sensor->name : device.card;
  // The size of grey buffers is the size of a transfer, not of the sensor.
  if (sensor != nullptr)
    camera.sensor = sensor->size;
  else if (!is_grey)
    camera.sensor = device.buffers;
  return camera;
}

}  // namespace eventcamera
