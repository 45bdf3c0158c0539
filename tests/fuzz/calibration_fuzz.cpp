// SPDX-License-Identifier: LGPL-2.1-or-later
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "src/filter/camera_calibration.hpp"
#include "src/filter/undistort_filter.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

/// Whatever a file says, events stay within the sensor.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace eventcamera;
  constexpr SensorSize sensor{6, 4};
  try {
    const auto calibration = parse_calibration({reinterpret_cast<const char*>(data), size});
    const UndistortFilter filter(sensor, calibration);
    std::vector<Event> events;
    for (int y = 0; y < sensor.height; ++y)
      for (int x = 0; x < sensor.width; ++x) events.push_back(Event::at(x, y, 0, Polarity::on));
    for (const auto& event : filter.filter({events, {}}).events)
      fuzz::require(
          event.x < sensor.width && event.y() < sensor.height && event.polarity() == Polarity::on,
          "events stay within the sensor");
  } catch (const std::invalid_argument&) {  // no calibration
  }
  return 0;
}
