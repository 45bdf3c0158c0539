// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/formats/byte_source.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"

namespace eventcamera {

/// Opens a file of the HDF5 library, to be read from a source that has to live for as long. An
/// empty handle where the library cannot.
Hdf5Handle open_hdf5(ByteSource& source);

}  // namespace eventcamera
