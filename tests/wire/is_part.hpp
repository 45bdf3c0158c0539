// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <vector>

#include "src/core/event.hpp"

/// True if all of `some` are in `all`, in the same order.
inline bool is_part(const std::vector<eventcamera::AbsoluteEvent>& some,
                    const std::vector<eventcamera::AbsoluteEvent>& all) {
  auto next = all.begin();
  for (const auto& event : some) {
    next = std::find(next, all.end(), event);
    if (next == all.end()) return false;
    ++next;
  }
  return true;
}
