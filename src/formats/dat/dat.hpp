// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/decoder.hpp"
#include "src/formats/encoder.hpp"

namespace eventcamera {

/// Prophesee's DAT files ("DAT file format"), of events or of triggers, versions 1 and 2. Their
/// times have 32 bits and wrap every 71 minutes: a wrap is known by a fall of more than half of
/// that.
std::unique_ptr<Decoder> make_dat_decoder();

/// Version 2. What is silent for more than 35 minutes may be read as silent for 71 minutes less:
/// the format has nothing to fill silence with. The sensor has at most 16384x16384 pixels; throws
/// std::invalid_argument.
std::unique_ptr<Encoder> make_dat_encoder(SensorSize size);

}  // namespace eventcamera
