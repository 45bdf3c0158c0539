// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string>

#include "src/formats/event_table.hpp"

namespace eventcamera {

/// Format of an HDF5 file of events.
enum class Hdf5Format : std::uint8_t {
  dsec,        ///< datasets t, x, y and p of a group; written with /ms_to_idx and /t_offset
  v2e,         ///< /events, rows or records of t, x, y, p
  metavision,  ///< /CD/events and /EXT_TRIGGER/events, compressed with ECF
  mvsec,       ///< /davis/left/events, rows of x, y, t in seconds, p
};

/// Selects the events of a file to read.
struct Hdf5Selection {
  std::string path = {};     ///< of a dataset or a group; empty: the first events
  TableSettings table = {};  ///< columns are for rows without names
};

/// Compression of the DSEC layout.
enum class Hdf5Compression : std::uint8_t { none, gzip };

}  // namespace eventcamera
