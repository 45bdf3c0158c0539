// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "src/core/event.hpp"

namespace eventcamera {

/// Output of a decoder, which only appends.
struct Decoded {
  std::vector<AbsoluteEvent> events;
  std::vector<Trigger> triggers;
};

}  // namespace eventcamera
