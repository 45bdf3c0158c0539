// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/decoder.hpp"
#include "src/formats/event_table.hpp"

namespace eventcamera {

/// Creates a reader for NumPy archives: arrays named t, x, y and p, and for labels cause and class,
/// or one array of events as in an .npy file. The numbers named width and height, if any, are the
/// sensor size. Pushed bytes are collected in memory, up to 256 MiB, until their end, where an
/// archive has its directory.
std::unique_ptr<Decoder> make_npz_decoder(const TableSettings& settings = {});

}  // namespace eventcamera
