// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/filter/scale_filter.hpp"

#include <algorithm>

#include "src/filter/filter.hpp"

namespace eventcamera {

ScaleFilter::ScaleFilter(SensorSize in, SensorSize out)
    : is_same_size_(in == out),
      columns_(static_cast<std::size_t>(in.width)),
      rows_(static_cast<std::size_t>(in.height)),
      last_kept_(2 * static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height)),
      counts_(last_kept_.size()) {
  for (int x = 0; x < in.width; ++x)
    columns_[static_cast<std::size_t>(x)] =
        static_cast<std::uint16_t>(std::int64_t{x} * out.width / in.width);
  for (int y = 0; y < in.height; ++y) {
    const auto row = static_cast<std::uint16_t>(std::int64_t{y} * out.height / in.height);
    rows_[static_cast<std::size_t>(y)] = {row * static_cast<std::uint32_t>(out.width), row};
  }
}

void ScaleFilter::forget() {
  std::ranges::fill(last_kept_, Moment{0});
  std::ranges::fill(counts_, std::uint16_t{0});
  moment_ = 0;
  time_ = std::numeric_limits<Microseconds>::min() / 2;
}

LabelledEvents ScaleFilter::filter(LabelledEvents events, Microseconds start,
                                   const Settings& settings) {
  if (settings.min_events > 1) return filter<true>(events, start, settings.min_events);
  return is_same_size_ ? events : filter<false>(events, start, 1);
}

template <bool counts>
LabelledEvents ScaleFilter::filter(LabelledEvents events, Microseconds start, unsigned min_events) {
  Microseconds previous = time_ - start;
  Moment moment = moment_;  // a local, which stores cannot alias
  const auto prefetch = [this](const Event& event) {
    __builtin_prefetch(&last_kept_[index(event)], 1);
    if constexpr (counts) __builtin_prefetch(&counts_[index(event)], 1);
  };
  const auto kept = keep_if_prefetched(events, prefetch, [&](Event& event) {
    moment = static_cast<Moment>(moment + (event.t != previous ? 1 : 0));
    previous = event.t;
    if (moment == 0) {
      std::ranges::fill(last_kept_, Moment{0});
      moment = 1;
    }
    const auto place = index(event);
    bool is_due = true;
    if constexpr (counts) {
      const unsigned count = counts_[place] + 1U;
      is_due = count >= min_events;
      // Branches on random pixels would be mispredicted.
      counts_[place] = static_cast<std::uint16_t>(count & (static_cast<unsigned>(is_due) - 1U));
    }
    auto& last_kept = last_kept_[place];
    const bool is_kept = (static_cast<int>(is_due) & static_cast<int>(last_kept != moment)) != 0;
    last_kept = is_kept ? moment : last_kept;
    const auto& row = rows_[static_cast<std::size_t>(event.y())];
    event = {event.t, columns_[event.x], static_cast<std::uint16_t>(row.y | (event.y_p & 0x8000U))};
    return is_kept;
  });
  moment_ = moment;
  time_ = start + previous;
  return kept;
}

}  // namespace eventcamera
