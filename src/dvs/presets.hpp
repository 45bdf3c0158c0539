// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/dvs/dvs_settings.hpp"

namespace eventcamera {

/// Settings that belong together.
enum class DvsPreset {
  ideal,      ///< neither noise nor delay
  esim,       ///< ESIM
  v2e_clean,  ///< v2e, its model "clean"
  v2e_noisy,  ///< v2e, its model "noisy"
  icns,       ///< IEBCS, the simulator of the ICNS
  davis346,   ///< iniVation DAVIS346
  gen4,       ///< Prophesee and Sony Gen4.1 (IMX636)
};

DvsSettings settings_of(DvsPreset preset);

}  // namespace eventcamera
