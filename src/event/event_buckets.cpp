// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/event/event_buckets.hpp"

#include <algorithm>

namespace eventcamera {

std::size_t EventBuckets::size() const {
  std::size_t sum = 0;
  for (const auto& bucket : buckets()) sum += bucket.size();
  return sum;
}

void EventBuckets::copy_to(Event* out) const {
  for (const auto& bucket : buckets()) out = std::copy(bucket.begin(), bucket.end(), out);
}

}  // namespace eventcamera
