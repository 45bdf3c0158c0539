// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>

#include "src/core/sensor_size.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/encoder.hpp"

namespace eventcamera {

/// Position of row 0 in a file. Tools disagree, and files do not state it; the format's authors
/// count from the bottom.
enum class EsOrigin : std::uint8_t { bottom_left, top_left };

/// Decodes Event Stream 2.0 as written by its authors' library sepia: streams of DVS events, of
/// ATIS events, of which exposures are skipped, and of colour events, as ON events without their
/// colours.
std::unique_ptr<EventDecoder> make_event_stream_decoder(EsOrigin origin = EsOrigin::bottom_left);

/// Encodes DVS events. The format fills pauses with a byte per 127 microseconds. Throws
/// std::invalid_argument for sensors of more than 16384x16384 pixels.
std::unique_ptr<Encoder> make_event_stream_encoder(SensorSize size,
                                                   EsOrigin origin = EsOrigin::bottom_left);

}  // namespace eventcamera
