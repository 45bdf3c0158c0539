// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/event_buckets.hpp"

#include <algorithm>

namespace eventcamera {

std::size_t EventBuckets::size() const {
  std::size_t sum = 0;
  for (const auto& bucket : buckets_) sum += bucket.size();
  return sum;
}

void EventBuckets::write_to(Event* out) const {
  write_part(0, size(), out);
}

void EventBuckets::write_to(Event* out, ThreadPool& threads) const {
  constexpr std::size_t worth_a_thread = 16'384;
  const std::size_t events = size();
  const auto parts =
      std::min(events / worth_a_thread + 1, static_cast<std::size_t>(threads.threads()));
  threads.for_each(static_cast<int>(parts), [&](int i, int) {
    const auto part = static_cast<std::size_t>(i);
    write_part(events * part / parts, events * (part + 1) / parts, out);
  });
}

void EventBuckets::write_part(std::size_t first, std::size_t last, Event* out) const {
  std::size_t before = 0;  // number of events in the buckets so far
  for (const auto& bucket : buckets_) {
    const std::size_t begin = std::max(first, before);
    const std::size_t end = std::min(last, before + bucket.events.size());
    if (begin < end) std::copy_n(bucket.events.data() + (begin - before), end - begin, out + begin);
    before += bucket.events.size();
    if (first <= before && before < last) bucket.pixels.write_to(out + before);
    before += bucket.pixels.size();
  }
}

}  // namespace eventcamera
