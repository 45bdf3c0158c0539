// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>

#include "src/core/label.hpp"

namespace eventcamera {

/// LabelledEvents::keep_if() for a filter that looks something up for each event: calls
/// prefetch(event) ahead of time, because the data of a random pixel is rarely in the cache.
template <class Prefetch, class Keep>
LabelledEvents keep_if_prefetched(LabelledEvents events, Prefetch prefetch, Keep keep) {
  constexpr std::size_t distance = 32;
  const Event* const data = events.events.data();
  const std::size_t last = std::max<std::size_t>(events.events.size(), 1) - 1;
  // What the loop needs is captured by value: writing events cannot change it.
  return events.keep_if([=, next = distance](Event& event) mutable {
    prefetch(data[std::min(next++, last)]);
    return keep(event);
  });
}

}  // namespace eventcamera
