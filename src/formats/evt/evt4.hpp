// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/encoder.hpp"
#include "src/formats/unit_reader.hpp"

namespace eventcamera {

/// EVT4 as Prophesee's OpenEB reads it: words of 32 bits, each an event, the high bits of the time,
/// or the head of a vector, whose second word is a mask of 32 pixels of a row. A size of 0x0 is one
/// that is not known.
std::unique_ptr<UnitReader> make_evt4_reader(SensorSize size);
std::unique_ptr<Encoder> make_evt4_encoder();

}  // namespace eventcamera
