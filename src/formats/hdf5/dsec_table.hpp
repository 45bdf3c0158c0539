// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>
#include <string>

#include "src/formats/hdf5/hdf5_table.hpp"

namespace eventcamera {

/// Creates the table of a group with a column each for t, x, y and p: the DSEC layout, and others
/// without its index. Throws UnsupportedFormat.
std::unique_ptr<Hdf5Table> make_dsec_table(hid_t file, const std::string& group);

}  // namespace eventcamera
