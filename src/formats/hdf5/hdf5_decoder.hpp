// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>

#include "src/formats/decoder.hpp"
#include "src/formats/event_table.hpp"

namespace eventcamera {

/// Selects the events of a file to read.
struct Hdf5Selection {
  std::string path = {};     ///< of a dataset or a group; empty: the first events
  TableSettings table = {};  ///< columns are for rows without names
};

/// Decodes HDF5 files of any known layout. A pushed file is collected in memory, up to 256 MiB, and
/// read at its end, because HDF5 needs random access. Triggers precede the events after them.
std::unique_ptr<Decoder> make_hdf5_decoder(Hdf5Selection selection = {});

}  // namespace eventcamera
