// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/event_buckets.hpp"

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

void EventBuckets::copy_to(Event* out, ThreadPool& threads) const {
  constexpr std::size_t worth_a_thread = 32'768;
  const std::size_t events = size();
  const auto parts =
      std::min(events / worth_a_thread + 1, static_cast<std::size_t>(threads.threads()));
  threads.for_each(static_cast<int>(parts), [&](int i, int) {
    const auto part = static_cast<std::size_t>(i);
    copy_part(events * part / parts, events * (part + 1) / parts, out);
  });
}

void EventBuckets::copy_part(std::size_t first, std::size_t last, Event* out) const {
  std::size_t before = 0;  // number of events in the buckets so far
  for (const auto& bucket : buckets()) {
    const std::size_t begin = std::max(first, before);
    const std::size_t end = std::min(last, before + bucket.size());
    if (begin < end) std::copy_n(bucket.data() + (begin - before), end - begin, out + begin);
    before += bucket.size();
  }
}

}  // namespace eventcamera
