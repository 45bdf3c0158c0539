// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/filter/scale_filter.hpp"

#include <algorithm>

#include "src/filter/prefetched.hpp"

namespace eventcamera {

ScaleFilter::ScaleFilter(SensorSize in, SensorSize out)
    : is_same_size_(in == out),
      columns_(static_cast<std::size_t>(in.width)),
      rows_(static_cast<std::size_t>(in.height)),
      cells_(2 * static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height)) {
  for (int x = 0; x < in.width; ++x)
    columns_[static_cast<std::size_t>(x)] =
        static_cast<std::uint16_t>(std::int64_t{x} * out.width / in.width);
  for (int y = 0; y < in.height; ++y) {
    const auto row = static_cast<std::uint16_t>(std::int64_t{y} * out.height / in.height);
    rows_[static_cast<std::size_t>(y)] = {row * static_cast<std::uint32_t>(out.width), row};
  }
}

void ScaleFilter::forget() {
  std::ranges::fill(cells_, Cell{});
  moment_ = 0;
  time_ = std::numeric_limits<Microseconds>::min() / 2;
}

LabelledEvents ScaleFilter::filter(LabelledEvents events, Microseconds start,
                                   const Settings& settings) {
  if (is_same_size_ && settings.min_events <= 1) return events;
  Microseconds previous = time_ - start;
  Moment moment = moment_;  // a local variable, which no store can change
  const auto prefetch = [this](const Event& event) {
    __builtin_prefetch(&cells_[index(event)], 1);
  };
  const auto kept = keep_if_prefetched(events, prefetch, [&](Event& event) {
    moment = static_cast<Moment>(moment + (event.t != previous ? 1 : 0));
    previous = event.t;
    if (moment == 0) {
      for (auto& cell : cells_) cell.last_kept = 0;
      moment = 1;
    }
    auto& cell = cells_[index(event)];
    const unsigned count = cell.count + 1U;
    const bool is_due = count >= settings.min_events;
    const bool is_kept = static_cast<int>(is_due) & static_cast<int>(cell.last_kept != moment);
    cell = {is_kept ? moment : cell.last_kept, static_cast<std::uint16_t>(is_due ? 0 : count)};
    const auto& row = rows_[static_cast<std::size_t>(event.y())];
    event.x = columns_[event.x];
    event.y_p = static_cast<std::uint16_t>(row.y | (event.y_p & 0x8000U));
    return is_kept;
  });
  moment_ = moment;
  time_ = start + previous;
  return kept;
}

}  // namespace eventcamera
