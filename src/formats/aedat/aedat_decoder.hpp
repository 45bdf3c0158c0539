// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>

#include "src/core/sensor_size.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Decodes AEDAT 4, 3.1, 2.0 and 1.0, according to the first line of the file. The older versions
/// are read as a single stream of events (and triggers). `assumed` is the sensor size to use if an
/// AEDAT 2.0 file states neither that nor the camera.
std::unique_ptr<Decoder> make_aedat_decoder(SensorSize assumed = {});

/// Versions of AEDAT whose records are an address and a time: 1.0 has addresses of 16 bits, of a
/// DVS128.
enum class Aedat2Version : std::uint8_t { one, two };

/// Decodes AEDAT 2.0 of DAVIS cameras, the DVS128 and v2e, and AEDAT 1.0. Skips frames and IMU
/// samples.
///
/// If the header names no camera, the first addresses determine their layout. A sensor size that
/// neither the header nor the user states stays 0x0, and then events are mirrored.
std::unique_ptr<EventDecoder> make_aedat2_decoder(SensorSize assumed = {},
                                                  Aedat2Version version = Aedat2Version::two);

/// Decodes AEDAT 3.1: polarity events, and edges on the camera's inputs. Skips frames, IMU samples
/// and all other packets. The size stays 0x0 if the header names no known camera.
std::unique_ptr<EventDecoder> make_aedat3_decoder();

}  // namespace eventcamera
