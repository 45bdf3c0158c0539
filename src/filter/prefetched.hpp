// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>

#include "src/core/label.hpp"

namespace eventcamera {

/// LabelledEvents::keep_if() for a filter that looks something up for each event: calls
/// prefetch(event), early enough to load it into the cache, where that of random pixels is not.
template <class Prefetch, class Keep>
LabelledEvents keep_if_prefetched(LabelledEvents events, const Prefetch& prefetch,
                                  const Keep& keep) {
  constexpr std::size_t distance = 16;
  if (events.events.empty()) return events;
  const Event* const last = events.events.data() + events.events.size() - 1;
  const Event* ahead = events.events.data() + std::min(distance, events.events.size() - 1);
  return events.keep_if([&](Event& event) {
    prefetch(*ahead);
    ahead = std::min(ahead + 1, last);
    return keep(event);
  });
}

}  // namespace eventcamera
