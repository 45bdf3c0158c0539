// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <memory>

#include "src/formats/hdf5/hdf5_table.hpp"

namespace eventcamera {

/// Columns of rows, by their place: t, x, y and p.
using ColumnOrder = std::array<std::size_t, event_columns>;

/// Creates the table of a layout with the numbers of each event in a row: v2e, Metavision without
/// compression, and MVSEC. Times have 32 bits if `wraps`. Throws UnsupportedFormat.
std::unique_ptr<Hdf5Table> make_row_table(Hdf5Format format, Hdf5Dataset events, SensorSize size,
                                          bool wraps, const ColumnOrder& order = {0, 1, 2, 3});

}  // namespace eventcamera
