// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/encoder.hpp"
#include "src/formats/unit_reader.hpp"

namespace eventcamera {

/// EVT2 as Prophesee documents it ("EVT 2.0 Format"): words of 32 bits, each an event, or the high
/// bits of the time. A size of 0x0 is one that is not known.
std::unique_ptr<UnitReader> make_evt2_reader(SensorSize size);
std::unique_ptr<Encoder> make_evt2_encoder();

}  // namespace eventcamera
