// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/readout.hpp"

#include <algorithm>
#include <cstring>

namespace eventcamera {

Readout::Readout(int width, int height)
    : width_(width),
      waiting_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)),
      rows_(height),
      row_queue_(height) {}

void Readout::reset() {
  std::fill(waiting_.begin(), waiting_.end(), Waiting{0});
  std::fill(rows_.begin(), rows_.end(), Row{});
  queue_first_ = queue_count_ = 0;
  unfinished_ = 0;
}

void Readout::read(std::span<const Event> in, double duration, double events_per_second,
                   StepBuckets& out) {
  constexpr double min_rate = 1e-9;  // an event in 30 years: a lower rate makes no difference
  const double time_per_event = 1e6 / std::max(events_per_second, min_rate);
  double idle_from = unfinished_ * time_per_event;  // microseconds after the start of the interval
  out.reset(1, 1);
  auto& left = out.bucket(1, 0);
  const auto serve_until = [&](double time) {
    while (queue_count_ > 0 && idle_from < time) {
      const int row = row_queue_[queue_first_];
      queue_first_ = (queue_first_ + 1) % row_queue_.size();
      --queue_count_;
      const int count = rows_[row].count;
      serve(row, static_cast<std::uint32_t>(idle_from), left);
      idle_from += count * time_per_event;
    }
  };
  for (const auto& event : in) {
    serve_until(event.t);
    if (queue_count_ == 0) idle_from = std::max<double>(idle_from, event.t);
    admit(event);
  }
  serve_until(duration);
  unfinished_ =
      std::clamp((idle_from - duration) / time_per_event, 0.0, static_cast<double>(width_));
  sort_within_spans(left, 0);
}

void Readout::admit(const Event& event) {
  const Event pixel = without_cause(event);
  const int x = pixel.x;
  auto& waiting = waiting_[place_of(x, pixel.y())];
  if (waiting != 0) return;
  const auto cause = static_cast<unsigned>(cause_of(event)) << cause_shift;
  const auto on = event.polarity() == Polarity::on ? on_bit : Waiting{0};
  waiting = static_cast<Waiting>(waits_bit | on | cause);
  auto& row = rows_[pixel.y()];
  if (row.count++ == 0) {
    row_queue_[(queue_first_ + queue_count_++) % row_queue_.size()] = pixel.y();
    row.first = x;
    row.last = x + 1;
  } else {
    row.first = std::min(row.first, x);
    row.last = std::max(row.last, x + 1);
  }
}

void Readout::append(int y, std::uint32_t t, std::vector<Event>& out) const {
  const auto& row = rows_[y];
  const Waiting* waiting = waiting_.data() + place_of(0, y);
  constexpr int block = sizeof(std::uint64_t);  // of pixels, most of which have no event
  for (int x = row.first, left = row.count; left > 0;) {
    std::uint64_t here = 0;
    if (x + block <= row.last) std::memcpy(&here, waiting + x, block);
    if (x + block <= row.last && here == 0) {
      x += block;
      continue;
    }
    if (waiting[x] != 0) {
      const auto polarity = (waiting[x] & on_bit) != 0 ? Polarity::on : Polarity::off;
      const auto cause = static_cast<Cause>((waiting[x] & cause_bits) >> cause_shift);
      out.push_back(with_cause(Event::at(x, y, t, polarity), cause));
      --left;
    }
    ++x;
  }
}

void Readout::serve(int y, std::uint32_t t, std::vector<Event>& out) {
  append(y, t, out);
  auto& row = rows_[y];
  auto* waiting = waiting_.data() + place_of(0, y);
  std::fill(waiting + row.first, waiting + row.last, Waiting{0});
  row = {};
}

}  // namespace eventcamera
