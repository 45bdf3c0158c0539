// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/core/sensor_size.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/encoder.hpp"

namespace eventcamera {

/// Decodes Prophesee DAT files ("DAT file format") of events or triggers, versions 1 and 2. Their
/// times have 32 bits and wrap every 71 minutes: a decrease by more than half of that is a wrap.
std::unique_ptr<EventDecoder> make_dat_decoder();

/// Encodes version 2. A first time of 71 minutes or more becomes 0. Pauses that readers would
/// misinterpret are removed: 71 minutes or more, or more than 35 minutes with a wrap. Throws
/// std::invalid_argument for sensors of more than 16384x16384 pixels.
std::unique_ptr<Encoder> make_dat_encoder(SensorSize size);

}  // namespace eventcamera
