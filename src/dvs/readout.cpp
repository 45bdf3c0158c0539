// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/dvs/readout.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "src/core/event.hpp"

namespace eventcamera {
namespace {

/// Log2 of the maximum number of time slices of an interval: enough for threads to share.
constexpr int slice_bits = 6;

}  // namespace

void EventSorter::begin(double duration, int bands) {
  duration_ = duration;
  const auto last = static_cast<std::uint32_t>(duration);
  shift_ = std::max(0, static_cast<int>(std::bit_width(last)) - slice_bits);
  slices_ = static_cast<int>(last >> shift_) + 1;
  collected_.reset(slices_, bands);
  deferred_.resize(static_cast<std::size_t>(bands));
  for (int band = 0; band < bands; ++band)
    std::erase_if(deferred_[static_cast<std::size_t>(band)], [&](const DeferredEvent& deferred) {
      if (deferred.t > duration) return false;
      const Event& event = deferred.event;
      add(band, deferred.t, event.x, event.y(), event.polarity());
      return true;
    });
}

void EventSorter::finish(EventBuckets& events, ThreadPool& threads) {
  events.reset(slices_, 1);
  counts_.resize(static_cast<std::size_t>(threads.threads()));
  threads.for_each(slices_, [&](int slice, int thread) {
    sort_slice(slice, counts_[static_cast<std::size_t>(thread)], events.bucket(slice + 1, 0));
  });
  for (auto& band : deferred_)
    for (auto& deferred : band) deferred.t -= duration_;
}

void EventSorter::sort_slice(int slice, std::vector<std::uint32_t>& counts,
                             std::vector<Event>& out) {
  const int bands = collected_.bands();
  std::size_t size = 0;
  for (int band = 0; band < bands; ++band) size += collected_.bucket(slice + 1, band).size();
  out.resize(size);
  if (size == 0) return;

  const std::size_t microseconds = std::size_t{1} << shift_;
  if (microseconds > 4 * size) {
    auto* end = out.data();
    for (int band = 0; band < bands; ++band) {
      const auto& bucket = collected_.bucket(slice + 1, band);
      end = std::copy(bucket.begin(), bucket.end(), end);
    }
    std::sort(out.begin(), out.end(), is_before);
    return;
  }

  // Counting sort by microsecond.
  const std::uint32_t first = static_cast<std::uint32_t>(slice) << shift_;
  counts.assign(microseconds + 1, 0);
  for (int band = 0; band < bands; ++band)
    for (const auto& event : collected_.bucket(slice + 1, band)) ++counts[event.t - first + 1];
  for (std::size_t i = 1; i <= microseconds; ++i) counts[i] += counts[i - 1];
  for (int band = 0; band < bands; ++band)
    for (const auto& event : collected_.bucket(slice + 1, band))
      out[counts[event.t - first]++] = event;
  sort_within_times(out);
}

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

void Readout::pass(const EventBuckets& in, double duration, double events_per_second,
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
  in.visit_band(0, [&](std::span<const Event> events) {
    for (const auto& event : events) {
      serve_until(event.t);
      if (queue_count_ == 0) idle_from_ = std::max<double>(idle_from_, event.t);
      admit(event);
    }
  });
  serve_until(duration);
  idle_from_ = std::max(0.0, idle_from_ - duration);
  sort_within_times(left);
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
  auto& row = rows_[static_cast<std::size_t>(event.y())];
  if (row.count++ == 0) {
    row.first = place;
    row_queue_[(queue_first_ + queue_count_++) % row_queue_.size()] = event.y();
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
