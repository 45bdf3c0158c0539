// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "src/core/sensor_size.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Decodes the `.bin` files of N-MNIST and N-Caltech101, recorded with an ATIS: five bytes an
/// event, without a header. A size of 0x0 means unknown.
std::unique_ptr<EventDecoder> make_atis_bin_decoder(SensorSize size);

/// True if a file starts with such events. There is no signature: many events must be in order of
/// time from the start of the file on, at various pixels.
bool is_atis_bin(std::span<const std::uint8_t> bytes);

}  // namespace eventcamera
