// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/core/sensor_size.hpp"
#include "src/formats/encoder.hpp"

namespace eventcamera {

/// Creates an encoder of NumPy archives: width and height of the sensor, and arrays t (int64,
/// microseconds), x, y (uint16) and p (uint8, 1 = ON); if there are labels, also cause (uint8) and
/// class (uint16), 0 where they are unknown. An archive stores one array after the other, so until
/// finish() the events are in temporary files: 13 bytes each, 16 with labels.
std::unique_ptr<Encoder> make_npz_encoder(SensorSize size);

}  // namespace eventcamera
