// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/encoder.hpp"
#include "src/formats/unit_reader.hpp"

namespace eventcamera {

/// EVT3 as Prophesee documents it ("EVT 3.0 Format"): words of 16 bits, each a change of what is
/// known of the events that follow, or some events. A size of 0x0 is one that is not known.
std::unique_ptr<UnitReader> make_evt3_reader(SensorSize size);

/// What it writes every known reader reads alike: vectors only as the whole of VECT_BASE_X,
/// VECT_12, VECT_12, VECT_8 and within the sensor, TIME_LOW after every TIME_HIGH, and a TIME_HIGH
/// for every 4096 microseconds, through silence, too.
std::unique_ptr<Encoder> make_evt3_encoder(SensorSize size);

}  // namespace eventcamera
