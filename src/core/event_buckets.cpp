// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/event_buckets.hpp"

#include <algorithm>

namespace eventcamera {

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

std::size_t StepBuckets::size() const {
  std::size_t sum = 0;
  for (const auto& [events, pixels] : buckets_) sum += events.size() + pixels.size();
  return sum;
}

void StepBuckets::visit_band(int band, const Visit& visit) const {
  for (auto i = static_cast<std::size_t>(band); i < buckets_.size(); i += bands_) {
    visit(buckets_[i].events);
    buckets_[i].pixels.visit(visit);
  }
}

void StepBuckets::write_part(std::size_t first, std::size_t last, Event* out) const {
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
