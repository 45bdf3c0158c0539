// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/encoder.hpp"
#include "src/formats/unit_reader.hpp"

namespace eventcamera {

/// The order of the bytes of EVT2.1's words: little-endian, or as Gen4.1 and IMX636 cameras have
/// it: the upper half first, each half little-endian.
enum class Evt21Order { little, legacy };

/// EVT2.1 as Prophesee documents it ("EVT 2.1 Format"): words of 64 bits, each up to 32 events of a
/// row, or the high bits of the time. A size of 0x0 is one that is not known.
std::unique_ptr<UnitReader> make_evt21_reader(Evt21Order order, SensorSize size);
std::unique_ptr<Encoder> make_evt21_encoder(Evt21Order order);

}  // namespace eventcamera
