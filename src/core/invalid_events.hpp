// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>

namespace eventcamera {

/// Numbers of events of a buffer that cannot be used.
struct InvalidEvents {
  std::size_t outside = 0;   ///< x or y past the sensor
  std::size_t unsorted = 0;  ///< earlier than the previous event, or past the end of the buffer

  friend bool operator==(const InvalidEvents&, const InvalidEvents&) = default;
};

}  // namespace eventcamera
