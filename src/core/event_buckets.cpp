// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/event_buckets.hpp"

#include <algorithm>
#include <bit>
#include <numeric>

namespace eventcamera {
namespace {

using Buckets = std::span<const EventBuckets::Bucket>;

std::size_t size_of(Buckets buckets) {
  std::size_t sum = 0;
  for (const auto& bucket : buckets) sum += bucket.size();
  return sum;
}

/// Writes the sorted events of a time slice of 2^slice_bits microseconds. A bin holds the events of
/// a microsecond, or of more, so that there are at most a few times as many bins as events.
void write_slice(Buckets bands, int slice_bits, std::span<Event> out) {
  constexpr int max_bins_bits = 12;
  const int bins_bits = std::min(max_bins_bits, static_cast<int>(std::bit_width(4 * out.size())));
  const int bin_bits = std::max(0, slice_bits - bins_bits);
  const std::uint32_t bins = std::uint32_t{1} << (slice_bits - bin_bits);
  const auto bin_of = [&](const Event& event) { return event.t >> bin_bits & (bins - 1); };
  std::uint32_t starts[(1 << max_bins_bits) + 1];
  std::fill_n(starts, bins + 1, 0);
  for (const auto& band : bands)
    for (const auto& event : band.events) ++starts[bin_of(event) + 1];
  std::partial_sum(starts, starts + bins, starts);
  for (const auto& band : bands)
    for (const auto& event : band.events) out[starts[bin_of(event)]++] = event;
  sort_within_spans(out, bin_bits);
}

}  // namespace

void EventBuckets::reset_slices(std::uint32_t duration, int bands) {
  constexpr int max_slices_bits = 6;  // enough for threads to share
  const int slice_bits = std::max(0, static_cast<int>(std::bit_width(duration)) - max_slices_bits);
  reset(static_cast<int>(duration >> slice_bits) + 1, bands);
  slice_bits_ = slice_bits;
}

std::size_t EventBuckets::size() const {
  return size_of(buckets_);
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
  if (slice_bits_) return write_slices(first, last, out);
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

void EventBuckets::write_slices(std::size_t first, std::size_t last, Event* out) const {
  std::size_t before = 0;  // number of events in the slices so far
  for (auto rest = Buckets(buckets_); !rest.empty(); rest = rest.subspan(bands_)) {
    const auto slice = rest.first(bands_);
    const std::size_t size = size_of(slice);
    if (first <= before && before < last) write_slice(slice, *slice_bits_, {out + before, size});
    before += size;
  }
}

}  // namespace eventcamera
