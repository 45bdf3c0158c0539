// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>

#include "src/formats/event_table.hpp"
#include "src/formats/hdf5/hdf5_table.hpp"

namespace eventcamera {

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
