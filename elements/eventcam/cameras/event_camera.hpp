// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "src/core/sensor_size.hpp"
#include "src/formats/evt/raw.hpp"

namespace eventcamera {

/// Properties of a Linux video device, as its drivers report them.
struct VideoDevice {
  std::string driver;
  std::string card;
  std::string fourcc;            ///< of its buffers
  SensorSize buffers = {};       ///< width and height of its buffers
  std::string sensor = {};       ///< sensor entity of its media device: "genx320 10-003c"
  std::string word_format = {};  ///< value of the sensor's control evt_format
};

/// A video device that delivers EVT words.
struct EventCamera {
  std::string name;                 ///< for users
  std::optional<EvtFormat> format;  ///< none if the drivers do not report it
  SensorSize sensor;                ///< 0x0 if unknown
  bool is_grey = false;             ///< words come in buffers of grey pixels
};

/// Word format of a V4L2 fourcc of Prophesee's drivers for Zynq; Linux itself defines none.
std::optional<EvtFormat> words_of_fourcc(std::string_view fourcc);

/// Recognises the devices of Prophesee's drivers (github.com/prophesee-ai: zynq-video-drivers,
/// rpi-sensor-drivers): by their formats, or grey buffers of their sensors.
std::optional<EventCamera> event_camera_of(const VideoDevice& device);

}  // namespace eventcamera
