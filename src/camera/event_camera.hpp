// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "src/core/sensor_size.hpp"
#include "src/formats/evt/raw.hpp"

namespace eventcamera {

/// What the drivers of Linux say of a video device.
struct VideoDevice {
  std::string driver;
  std::string card;
  std::string fourcc;            ///< of its buffers
  SensorSize buffers = {};       ///< their width and height
  std::string sensor = {};       ///< that of its media device, such as "genx320 10-003c"
  std::string word_format = {};  ///< control evt_format of the sensor
};

/// A video device that delivers EVT words.
struct EventCamera {
  std::string name;                 ///< for users
  std::optional<EvtFormat> format;  ///< nothing if the drivers do not say
  SensorSize sensor;                ///< 0x0 if unknown
  bool is_grey = false;             ///< words come in buffers of grey pixels
};

/// Formats of V4L2, as the drivers of Prophesee for Zynq name them; upstream Linux has none.
std::optional<EvtFormat> words_of_fourcc(std::string_view fourcc);

/// Recognises the devices of Prophesee's drivers (github.com/prophesee-ai: zynq-video-drivers,
/// rpi-sensor-drivers): by their formats, or grey buffers of their sensors.
std::optional<EventCamera> event_camera_of(const VideoDevice& device);

}  // namespace eventcamera
