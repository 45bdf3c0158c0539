// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>

#include "src/core/sensor_size.hpp"
#include "src/formats/encoder.hpp"

namespace eventcamera {

/// How events are encoded in the messages of a bag, event_camera_msgs/EventPacket.
enum class BagEvents : std::uint8_t { evt3, mono };

enum class BagCompression : std::uint8_t { none, lz4, zstd };

struct McapSettings {
  SensorSize size;
  BagEvents events = BagEvents::evt3;
  BagCompression compression = BagCompression::none;
};

/// Writes an MCAP file of ROS 2 with one topic, /event_camera/events, an index and checksums.
///
/// A packet holds up to 10 ms, and can be decoded without those before it. Stamps are the times of
/// the first events, so that the times of all events are exact. Triggers are written with evt3.
/// Throws std::invalid_argument for sensors of more than 2048x2048 pixels with evt3.
std::unique_ptr<Encoder> make_mcap_encoder(const McapSettings& settings);

}  // namespace eventcamera
