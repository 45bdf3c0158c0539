// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/decoder.hpp"
#include "src/formats/hdf5/hdf5_format.hpp"

namespace eventcamera {

/// Creates a decoder for HDF5 files. A pushed file is collected in memory, up to 256 MiB, and read
/// at its end, because HDF5 needs random access.
std::unique_ptr<Decoder> make_hdf5_decoder(Hdf5Selection selection = {});

}  // namespace eventcamera
