// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <optional>
#include <string_view>

#include "src/core/sensor_size.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/encoder.hpp"

namespace eventcamera {

enum class EvtFormat { evt2, evt21, evt21_legacy, evt3, evt4 };

/// Name of a format, such as "EVT3". It does not include the order of the halves of EVT21 words.
const char* evt_format_name(EvtFormat format);

/// Format with this name; EVT21 has little-endian words.
std::optional<EvtFormat> evt_format_named(std::string_view name);

/// Decodes Prophesee RAW files ("RAW file format"): a text header, and words of the format that it
/// names.
std::unique_ptr<EventDecoder> make_prophesee_raw_decoder();

/// Throws std::invalid_argument for sensors of more than 2048x2048 pixels.
std::unique_ptr<Encoder> make_prophesee_raw_encoder(EvtFormat format, SensorSize size);

/// Words without a header.
std::unique_ptr<EventDecoder> make_evt_decoder(EvtFormat format, SensorSize size);
std::unique_ptr<Encoder> make_evt_encoder(EvtFormat format, SensorSize size);

}  // namespace eventcamera
