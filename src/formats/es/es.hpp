// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/decoder.hpp"
#include "src/formats/encoder.hpp"

namespace eventcamera {

/// Event Stream 2.0 as its authors' library sepia writes it: streams of DVS events, and of ATIS
/// events, whose changes are read and whose exposures are not. Rows are counted from the bottom in
/// these files, as the authors' tools do, and from the top here.
std::unique_ptr<Decoder> make_event_stream_decoder();

/// DVS events. The format fills silence with a byte for every 127 microseconds. The sensor has at
/// most 32768 rows and 65535 columns; throws std::invalid_argument.
std::unique_ptr<Encoder> make_event_stream_encoder(SensorSize size);

}  // namespace eventcamera
