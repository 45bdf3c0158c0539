// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/core/sensor_size.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/encoder.hpp"
#include "src/formats/event_table.hpp"

namespace eventcamera {

/// Creates a reader for NumPy archives: arrays named t, x, y and p, and for labels cause and class,
/// or one array of events as in an .npy file. The numbers named width and height, if any, are the
/// sensor size. Pushed bytes are collected in memory, up to 256 MiB, until their end, where an
/// archive has its directory.
std::unique_ptr<Decoder> make_npz_decoder(const TableSettings& settings = {});

/// Creates an encoder of NumPy archives: width and height of the sensor, and arrays t (int64,
/// microseconds), x, y (uint16) and p (uint8, 1 = ON); if there are labels, also cause (uint8) and
/// class (uint16), 0 where they are unknown. An archive stores one array after the other, so until
/// finish() the events are in temporary files: 13 bytes each, 16 with labels.
std::unique_ptr<Encoder> make_npz_encoder(SensorSize size);

}  // namespace eventcamera
