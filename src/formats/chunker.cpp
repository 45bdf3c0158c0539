// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/chunker.hpp"

#include <algorithm>
#include <cstring>

namespace eventcamera {
namespace {

bool earlier(const AbsoluteEvent& a, const AbsoluteEvent& b) {
  return a.t < b.t;
}

}  // namespace

IntervalEvents IntervalEvents::before(Microseconds duration) const {
  const auto end = std::ranges::partition_point(
      events_, [&](const AbsoluteEvent& event) { return event.t < start_ + duration; });
  return {start_, {events_.begin(), end}};
}

void IntervalEvents::write_to(Event* out) const {
  const auto start = start_;
  for (const auto& event : events_)
    *out++ = {static_cast<std::uint32_t>(event.t - start), event.x, event.y_p};
}

Chunker::Chunker(Microseconds length, Microseconds start)
    : length_(length), first_(start), given_start_(true), start_(start) {}

void Chunker::push(std::span<const AbsoluteEvent> events) {
  if (events.empty()) return;
  drop_handed_out();
  // Fast path: nearly always the events are in order and can be added at once.
  if (ahead_.empty() && latest_ != never && events.front().t >= std::max(latest_, start_) &&
      events.back().t <= latest_ + settled && keep_sorted(events))
    return;
  for (const auto& event : events) place(event);
}

/// Keeps events if they are sorted.
bool Chunker::keep_sorted(std::span<const AbsoluteEvent> events) {
  bool falls = false;  // without a branch, the loop runs at the speed of memory
  for (std::size_t i = 1; i < events.size(); ++i) falls |= events[i].t < events[i - 1].t;
  if (falls) return false;
  const auto before = kept_.size();
  kept_.resize(before + events.size());
  std::memcpy(static_cast<void*>(kept_.data() + before), events.data(), events.size_bytes());
  latest_ = events.back().t;
  return true;
}

void Chunker::place(const AbsoluteEvent& event) {
  if (event.t > max_time || event.t < -max_time) {
    ++dropped_.stray;
    return;
  }
  if (!ahead_.empty()) {
    if (event.t >= ahead_.front().t - settled) {
      ahead_.push_back(event);
      // The clock continues from where it jumped to.
      if (event.t - ahead_.front().t >= settled || ahead_.size() >= max_ahead) believe_ahead();
      return;
    }
    dropped_.stray += ahead_.size();
    ahead_.clear();
  }
  if (first_ && event.t < *first_ && given_start_) return;
  if (latest_ == never || event.t > latest_ + settled)
    ahead_.push_back(event);
  else
    keep(event);
}

void Chunker::keep(const AbsoluteEvent& event) {
  if (event.t < start_) {
    dropped_.late += static_cast<std::uint64_t>(!given_start_ || event.t >= *first_);
    return;
  }
  sorted_ &= event.t >= latest_;
  latest_ = std::max(latest_, event.t);
  kept_.push_back(event);
}

void Chunker::believe_ahead() {
  if (!first_) {
    first_ = std::min_element(ahead_.begin(), ahead_.end(), earlier)->t;
    start_ = *first_;
  }
  for (const auto& event : ahead_) keep(event);
  ahead_.clear();
}

void Chunker::reach(Microseconds t) {
  reached_ = std::max(reached_, std::clamp(t, -max_time, max_time));
  if (!ahead_.empty() && ahead_.front().t < reached_ + settled) believe_ahead();
}

void Chunker::finish() {
  if (!ahead_.empty()) believe_ahead();
  finished_ = true;
}

/// Erases returned events once they are by far the greater part, so that little is moved.
void Chunker::drop_handed_out() {
  if (head_ <= kept_.size() / 4 * 3) return;
  kept_.erase(kept_.begin(), kept_.begin() + static_cast<std::ptrdiff_t>(head_));
  head_ = 0;
}

void Chunker::sort() {
  if (sorted_) return;
  std::stable_sort(kept_.begin() + static_cast<std::ptrdiff_t>(head_), kept_.end(), earlier);
  sorted_ = true;
}

std::optional<Chunker::Interval> Chunker::next() {
  if (!first_) return std::nullopt;
  const auto waiting = kept_.size() - head_;
  auto due = reached_;
  if (latest_ != never) due = std::max(due, latest_ - settled);
  const auto end = grid_before(start_) + length_;
  if (finished_) {
    if (waiting == 0) return std::nullopt;
    due = latest_ + 1;
  } else if (end > due && waiting < max_events) {
    return std::nullopt;
  }
  sort();
  if (end > due) {
    // The last interval ends with the last event; an overfull one is cut at its median.
    const auto middle = kept_[head_ + waiting / 2].t;
    return hand_out(finished_ ? due : std::max(middle, start_ + 1));
  }
  const auto silent_until =
      waiting == 0 ? grid_before(due) : grid_before(std::min(due, kept_[head_].t));
  return hand_out(std::max(end, silent_until));
}

Chunker::Interval Chunker::hand_out(Microseconds end) {
  const auto from = kept_.begin() + static_cast<std::ptrdiff_t>(head_);
  const auto to =
      std::partition_point(from, kept_.end(), [end](const auto& event) { return event.t < end; });
  const Interval interval{start_, end - start_, {start_, {from, to}}};
  head_ = static_cast<std::size_t>(to - kept_.begin());
  start_ = end;
  return interval;
}

}  // namespace eventcamera
