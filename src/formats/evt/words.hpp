// SPDX-License-Identifier: LGPL-2.1-or-later
// The words of EVT formats.
#pragma once

#include <bit>
#include <cstdint>
#include <memory>
#include <string>

#include "src/formats/encoder.hpp"
#include "src/formats/evt/raw.hpp"
#include "src/formats/unit_stream_decoder.hpp"

namespace eventcamera {

/// Columns and rows have 11 bits.
constexpr int max_evt_side = 2048;

/// Corruption of a TIME_HIGH, or of the one before it.
inline constexpr const char* time_falls = "EVT time falls without a wrap";

/// A size of 0x0 means unknown.
std::unique_ptr<UnitDecoder> make_evt_unit_decoder(EvtFormat format, SensorSize size);
std::unique_ptr<UnitDecoder> make_evt3_unit_decoder(SensorSize size);

/// `header` is written before the words.
std::unique_ptr<Encoder> make_evt_encoder(EvtFormat format, SensorSize size, std::string header);
std::unique_ptr<Encoder> make_evt3_encoder(SensorSize size, std::string header);

/// Writes an event for each set bit i of `mask`, i pixels to the right of `first`. Returns the end
/// of the events.
inline AbsoluteEvent* expand(std::uint32_t mask, const AbsoluteEvent& first,
                             AbsoluteEvent* events) {
  for (; mask != 0; mask &= mask - 1)
    *events++ = {first.t, static_cast<std::uint16_t>(first.x + std::countr_zero(mask)), first.y_p};
  return events;
}

}  // namespace eventcamera
