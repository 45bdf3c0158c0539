// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/rolling_shutter.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

namespace eventcamera {

std::vector<std::uint32_t> row_delays(Nanoseconds readout, int height) {
  std::vector<std::uint32_t> delays(static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y) {
    const int rows_before = readout < 0 ? height - 1 - y : y;
    delays[y] = static_cast<std::uint32_t>(std::abs(readout) * rows_before /
                                           std::max(1, height - 1) / 1000);
  }
  return delays;
}

void DelayedRows::set(const StepBuckets& events, Nanoseconds duration, Nanoseconds readout) {
  if (delays_.empty() || readout != readout_) delays_ = row_delays(readout, height_);
  readout_ = readout;
  end_ = static_cast<std::uint32_t>(duration / 1000);
  next_start_ = static_cast<std::uint32_t>((duration + 999) / 1000);
  rows_.clear();
  add_due();
  events.visit_buckets([&](std::span<const Event> list, const FiredPixels& pixels) {
    add_list(list);
    pixels.visit_rows([&](int y, std::span<const FiredPixels::Group> groups, std::size_t size) {
      const std::uint64_t t = std::uint64_t{pixels.time()} + delays_[y];
      add({t, y, size, {}, groups});
    });
  });
  sort();
}

/// Adds the rows that the last interval deferred.
void DelayedRows::add_due() {
  std::swap(due_, deferred_);
  deferred_.rows.clear();
  deferred_.events.clear();
  deferred_.pixels.clear();
  std::span<const Event> events = due_.events;
  std::span<const FiredPixels::Group> pixels = due_.pixels;
  for (auto& row : due_.rows) {
    row.events = events.first(row.events.size());
    row.pixels = pixels.first(row.pixels.size());
    events = events.subspan(row.events.size());
    pixels = pixels.subspan(row.pixels.size());
    add(row);
  }
}

/// Adds sorted events.
void DelayedRows::add_list(std::span<const Event> events) {
  for (auto first = events.begin(); first != events.end();) {
    const auto last = std::find_if(first, events.end(), [&](const Event& event) {
      return event.t != first->t || event.y() != first->y();
    });
    const std::uint64_t t = std::uint64_t{first->t} + delays_[first->y()];
    const std::span row(first, last);
    add({t, first->y(), row.size(), row, {}});
    first = last;
  }
}

/// Adds a row to the interval, or copies it for the next one.
void DelayedRows::add(Row row) {
  if (row.t <= end_) {
    rows_.push_back(row);
    return;
  }
  row.t -= next_start_;
  deferred_.rows.push_back(row);
  deferred_.events.insert(deferred_.events.end(), row.events.begin(), row.events.end());
  deferred_.pixels.insert(deferred_.pixels.end(), row.pixels.begin(), row.pixels.end());
}

void DelayedRows::sort() {
  sorted_.clear();
  for (const auto& row : rows_)
    sorted_.push_back({row.t << 16 | static_cast<std::uint64_t>(row.y), sorted_.size(), 0});
  std::ranges::sort(sorted_, {}, &SortedRow::time_and_y);
  size_ = 0;
  for (auto& row : sorted_) row.first = std::exchange(size_, size_ + rows_[row.row].size);
}

void DelayedRows::write(const Row& row, Event* out) {
  const auto t = static_cast<std::uint32_t>(row.t);
  for (const auto& event : row.events) *out++ = {t, event.x, event.y_p};
  if (!row.pixels.empty()) FiredPixels::write(row.pixels, t, {out, row.size});
}

void DelayedRows::write_part(std::size_t first, std::size_t last, Event* out) const {
  for (auto row = std::ranges::lower_bound(sorted_, first, {}, &SortedRow::first);
       row != sorted_.end() && row->first < last; ++row)
    write(rows_[row->row], out + row->first);
}

void DelayedRows::visit_band(int /*band*/, const Visit& visit) const {
  std::vector<Event> events(size_);
  write_part(0, size_, events.data());
  visit(events);
}

std::optional<Nanoseconds> DelayedRows::latest() const {
  std::optional<Nanoseconds> latest;
  for (const auto& row : deferred_.rows)
    latest = std::max(latest, std::optional(static_cast<Nanoseconds>(row.t) * 1000));
  return latest;
}

}  // namespace eventcamera
