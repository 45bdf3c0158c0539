// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/time_slices.hpp"

#include <algorithm>
#include <bit>
#include <numeric>

namespace eventcamera {
namespace {

/// Counting sort of a time slice of 2^slice_bits microseconds. visit_lists(visit) passes its events
/// to visit(std::span<const Event>, const Event& last) in lists; `last` is the last event of the
/// array that holds the list. Bins last a microsecond or more, and there are at most a few times as
/// many as events.
template <class VisitLists>
void write_slice(const VisitLists& visit_lists, int slice_bits, std::span<Event> out) {
  constexpr int max_bins_bits = 12;
  const int bins_bits = std::min(max_bins_bits, static_cast<int>(std::bit_width(4 * out.size())));
  const int bin_bits = std::max(0, slice_bits - bins_bits);
  const std::uint32_t bins = std::uint32_t{1} << (slice_bits - bin_bits);
  const auto bin_of = [&](const Event& event) { return event.t >> bin_bits & (bins - 1); };
  std::uint32_t starts[(1 << max_bins_bits) + 1];
  std::fill_n(starts, bins + 1, 0);
  std::size_t counted = 0;
  visit_lists([&](std::span<const Event> list, const Event& last) {
    for (const auto& event : list) {
      ++starts[bin_of(event) + 1];
      if (counted++ % (64 / sizeof(Event)) > 0) continue;  // once for each cache line
      __builtin_prefetch(&event + std::min<std::ptrdiff_t>(64, &last - &event));
      __builtin_prefetch(out.data() + counted, 1, 2);  // to be written in any order
    }
  });
  std::partial_sum(starts, starts + bins, starts);
  visit_lists([&](std::span<const Event> list, const Event& /*last*/) {
    for (const auto& event : list) out[starts[bin_of(event)]++] = event;
  });
  sort_within_spans(out, bin_bits);
}

}  // namespace

void TimeSlices::reset(std::uint32_t duration, int bands) {
  bands_ = static_cast<std::size_t>(bands);
  slice_bits_ = std::max(0, static_cast<int>(std::bit_width(duration)) - max_slices_bits);
  slices_.resize(bands_);
  for (auto& band : slices_) {
    band.events.clear();
    band.starts.fill(0);
  }
}

void TimeSlices::add(int band, std::span<const Event> events) {
  const auto slice_of = [this](const Event& event) { return event.t >> slice_bits_; };
  auto& [sliced, starts] = slices_[band];
  for (const auto& event : events) ++starts[slice_of(event) + 1];
  std::partial_sum(starts.begin(), starts.end(), starts.begin());
  auto ends = starts;
  sliced.assign(events.begin(), events.end());  // faster than to resize it with zeros
  for (const auto& event : events) sliced[ends[slice_of(event)]++] = event;
}

std::size_t TimeSlices::size() const {
  std::size_t sum = 0;
  for (const auto& band : slices_) sum += band.events.size();
  return sum;
}

void TimeSlices::visit_band(int band, const Visit& visit) const {
  visit(slices_[band].events);
}

void TimeSlices::write_part(std::size_t first, std::size_t last, Event* out) const {
  std::size_t before = 0;  // number of events in the slices so far
  for (std::size_t slice = 0; before < last && slice < (1 << max_slices_bits); ++slice) {
    const auto visit_bands = [&](const auto& visit) {
      for (const auto& [events, starts] : slices_) {
        const auto list =
            std::span(events).subspan(starts[slice], starts[slice + 1] - starts[slice]);
        if (!list.empty()) visit(list, events.back());
      }
    };
    std::size_t size = 0;
    visit_bands([&](std::span<const Event> list, const Event&) { size += list.size(); });
    if (first <= before && size > 0) write_slice(visit_bands, slice_bits_, {out + before, size});
    before += size;
  }
}

}  // namespace eventcamera
