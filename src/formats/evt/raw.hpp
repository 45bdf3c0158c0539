// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/decoder.hpp"
#include "src/formats/encoder.hpp"

namespace eventcamera {

/// The words of a RAW file.
enum class EvtFormat { evt2, evt21, evt21_legacy, evt3, evt4 };

/// Prophesee's RAW files ("RAW file format"): a header of text, and words that it names.
std::unique_ptr<Decoder> make_prophesee_raw_decoder();

/// The sensor has at most 2048x2048 pixels; throws std::invalid_argument.
std::unique_ptr<Encoder> make_prophesee_raw_encoder(EvtFormat format, SensorSize size);

/// The words without the header.
std::unique_ptr<Decoder> make_evt_decoder(EvtFormat format, SensorSize size);
std::unique_ptr<Encoder> make_evt_encoder(EvtFormat format, SensorSize size);

}  // namespace eventcamera
