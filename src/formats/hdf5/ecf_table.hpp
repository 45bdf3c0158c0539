// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/formats/hdf5/hdf5_table.hpp"

namespace eventcamera {

/// Creates the table of the Metavision layout with ECF compression. Throws UnsupportedFormat.
std::unique_ptr<Hdf5Table> make_ecf_table(Hdf5Dataset events, SensorSize size);

}  // namespace eventcamera
