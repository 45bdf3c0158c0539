// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/readout.hpp"

#include <algorithm>
#include <utility>

namespace eventcamera {

Readout::Readout(int width, int height)
    : width_(width),
      rows_(static_cast<std::size_t>(height)),
      row_queue_(static_cast<std::size_t>(height)),
      waits_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

void Readout::reset() {
  waiting_.clear();
  free_ = none;
  std::fill(rows_.begin(), rows_.end(), Row{});
  queue_first_ = queue_count_ = 0;
  std::fill(waits_.begin(), waits_.end(), std::uint8_t{0});
  idle_from_ = 0;
}

void Readout::read(std::span<const Event> in, double duration, double events_per_second,
                   EventBuckets& out) {
  const double time_per_event = 1e6 / events_per_second;
  out.reset(1, 1);
  auto& left = out.bucket(1, 0);
  // Reads rows until `time`.
  const auto serve_until = [&](double time) {
    while (queue_count_ > 0 && idle_from_ < time) {
      const int row = row_queue_[queue_first_];
      queue_first_ = (queue_first_ + 1) % row_queue_.size();
      --queue_count_;
      const int count = rows_[static_cast<std::size_t>(row)].count;
      serve(row, static_cast<std::uint32_t>(idle_from_), left);
      idle_from_ += count * time_per_event;
    }
  };
  for (const auto& event : in) {
    serve_until(event.t);
    if (queue_count_ == 0) idle_from_ = std::max<double>(idle_from_, event.t);
    admit(event);
  }
  serve_until(duration);
  idle_from_ = std::max(0.0, idle_from_ - duration);
  sort_within_spans(left, 0);
}

void Readout::admit(const Event& event) {
  if (std::exchange(waits(event), 1) != 0) return;
  int place = free_;
  if (place == none) {
    place = static_cast<int>(waiting_.size());
    waiting_.push_back({});
  } else {
    free_ = waiting_[static_cast<std::size_t>(place)].next;
  }
  waiting_[static_cast<std::size_t>(place)] = {event, none};
  const int y = without_cause(event).y();
  auto& row = rows_[static_cast<std::size_t>(y)];
  if (row.count++ == 0) {
    row.first = place;
    row_queue_[(queue_first_ + queue_count_++) % row_queue_.size()] = y;
  } else {
    waiting_[static_cast<std::size_t>(row.last)].next = place;
  }
  row.last = place;
}

void Readout::serve(int y, std::uint32_t t, std::vector<Event>& out) {
  auto& row = rows_[static_cast<std::size_t>(y)];
  for (int place = row.first; place != none;) {
    auto& waiting = waiting_[static_cast<std::size_t>(place)];
    waits(waiting.event) = 0;
    waiting.event.t = t;
    out.push_back(waiting.event);
    const int next = waiting.next;
    waiting.next = free_;
    free_ = place;
    place = next;
  }
  row = {};
}

}  // namespace eventcamera
