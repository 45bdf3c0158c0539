// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/decoder.hpp"
#include "src/formats/encoder.hpp"

namespace eventcamera {

/// Decodes Event Stream 2.0 as written by its authors' library sepia: streams of DVS events, and of
/// ATIS events, of which exposures are skipped. Rows are counted from the bottom in these files, as
/// in the authors' tools, and from the top here.
std::unique_ptr<Decoder> make_event_stream_decoder();

/// Encodes DVS events. The format fills pauses with a byte per 127 microseconds. Throws
/// std::invalid_argument for sensors of more than 65535x32768 pixels.
std::unique_ptr<Encoder> make_event_stream_encoder(SensorSize size);

}  // namespace eventcamera
