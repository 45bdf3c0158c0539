// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>

#include "src/formats/event_table.hpp"
#include "src/formats/hdf5/hdf5_table.hpp"
#include "src/formats/table_sample.hpp"
#include "src/formats/unwrapped_clock.hpp"

namespace eventcamera {

/// Column numbers of t, x, y and p.
using ColumnOrder = std::array<std::size_t, event_columns>;

/// Creates the table of a dataset with the numbers of each event in a row: v2e, MVSEC, Metavision
/// without compression, and others. Detects the order and the unit unless they are known. Throws
/// UnsupportedFormat.
std::unique_ptr<Hdf5Table> make_row_table(Hdf5Format format, Hdf5Dataset events,
                                          const std::string& path, SensorSize size,
                                          std::optional<ColumnOrder> order,
                                          std::optional<TimeUnit> unit);

/// Datasets of a group that hold the columns t, x, y and p.
struct ColumnDatasets {
  std::string group;                 ///< empty or with a final slash
  std::array<std::string, 4> names;  ///< by EventColumn
  std::optional<TimeUnit> unit;      ///< in the name of the times
  std::optional<TimeUnit> set_unit;  ///< by the user
};

/// Creates the table of columns: the DSEC layout, and others without its index. Throws
/// UnsupportedFormat.
std::unique_ptr<Hdf5Table> make_dsec_table(hid_t file, const ColumnDatasets& datasets);

}  // namespace eventcamera
