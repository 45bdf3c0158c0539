// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/event_collector.hpp"

#include <algorithm>
#include <bit>

#include "src/core/raster_order.hpp"

namespace eventcamera {
namespace {

/// Into 2 to this power stretches an interval is cut at most: enough for threads to share.
constexpr int stretch_bits = 6;

}  // namespace

void EventOrder::begin(double duration, int bands) {
  duration_ = duration;
  const auto last = static_cast<std::uint32_t>(duration);
  shift_ = std::max(0, static_cast<int>(std::bit_width(last)) - stretch_bits);
  stretches_ = static_cast<int>(last >> shift_) + 1;
  collected_.reset(stretches_, bands);
  late_.resize(static_cast<std::size_t>(bands));
  for (int band = 0; band < bands; ++band) {
    auto& late = late_[static_cast<std::size_t>(band)];
    std::size_t kept = 0;
    for (auto& each : late) {
      if (each.t > duration) {
        late[kept++] = each;
        continue;
      }
      each.event.t = static_cast<std::uint32_t>(each.t);
      collected_.bucket(static_cast<int>(each.event.t >> shift_) + 1, band).push_back(each.event);
    }
    late.resize(kept);
  }
}

void EventOrder::finish(EventBuckets& events, ThreadPool& threads) {
  events.reset(stretches_, 1);
  counts_.resize(static_cast<std::size_t>(threads.threads()));
  threads.for_each(stretches_, [&](int stretch, int thread) {
    sort_stretch(stretch, counts_[static_cast<std::size_t>(thread)], events.bucket(stretch + 1, 0));
  });
  for (auto& late : late_)
    for (auto& each : late) each.t -= duration_;
}

void EventOrder::sort_stretch(int stretch, std::vector<std::uint32_t>& counts,
                              std::vector<Event>& out) {
  const int bands = collected_.bands();
  std::size_t size = 0;
  for (int band = 0; band < bands; ++band) size += collected_.bucket(stretch + 1, band).size();
  out.resize(size);
  if (size == 0) return;

  const std::size_t microseconds = std::size_t{1} << shift_;
  if (microseconds > 4 * size) {
    auto* end = out.data();
    for (int band = 0; band < bands; ++band) {
      const auto& bucket = collected_.bucket(stretch + 1, band);
      end = std::copy(bucket.begin(), bucket.end(), end);
    }
    std::sort(out.begin(), out.end(), is_before);
    return;
  }

  // By counting how many come before each microsecond.
  const std::uint32_t first = static_cast<std::uint32_t>(stretch) << shift_;
  counts.assign(microseconds + 1, 0);
  for (int band = 0; band < bands; ++band)
    for (const auto& event : collected_.bucket(stretch + 1, band)) ++counts[event.t - first + 1];
  for (std::size_t i = 1; i <= microseconds; ++i) counts[i] += counts[i - 1];
  for (int band = 0; band < bands; ++band)
    for (const auto& event : collected_.bucket(stretch + 1, band))
      out[counts[event.t - first]++] = event;
  sort_within_times(out);
}

}  // namespace eventcamera
