// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/tensor/window_queue.hpp"

#include <algorithm>

namespace eventcamera {
namespace {

constexpr Nanoseconds microsecond = 1000;

}  // namespace

void WindowQueue::reset() {
  validator_.restart();
  events_.clear();
  first_ = returned_ = 0;
  start_.reset();
  reached_.reset();
  intervals_.clear();
}

/// Waits until enough events have returned, so that each is moved about once.
void WindowQueue::drop_returned() {
  if (first_ < events_.size() - first_) return;
  events_.erase(events_.begin(), events_.begin() + static_cast<std::ptrdiff_t>(first_));
  for (auto& interval : intervals_) interval.last -= first_;
  returned_ -= std::min(returned_, first_);
  first_ = 0;
}

WindowQueue::Added WindowQueue::add(std::span<const Event> events, Microseconds base,
                                    Nanoseconds start, Nanoseconds end) {
  drop_returned();
  const auto clipped = std::ranges::find_if(
      events, [&](const Event& event) { return base + event.t >= start / microsecond; });
  events = events.subspan(static_cast<std::size_t>(clipped - events.begin()));
  start_ = of_intervals() ? std::max(start, reached_.value_or(start)) : start_.value_or(start);
  validator_.pass(*start_ / microsecond);
  const std::size_t before = events_.size();
  const auto fitting = events.first(std::min(events.size(), max_events - (before - first_)));
  events_.resize(before + fitting.size());
  auto out = events_.begin() + static_cast<std::ptrdiff_t>(before);
  Added added;
  // In a local, because the events written might alias members.
  auto validator = validator_;
  const Microseconds max_t = end / microsecond - base;
  added.invalid = validator.for_each_valid(fitting, base, max_t,
                                           [&](const AbsoluteEvent& event) { *out++ = event; });
  validator_ = validator;
  events_.erase(out, events_.end());

  // Events that do not fit are dropped if they belong to the next window, else they wait for it to
  // go.
  Nanoseconds complete = validator_.passed() * microsecond;
  if (settings_.events == 0) complete = std::max(complete, *start_ + settings_.duration);
  const auto rest = events.subspan(fitting.size());
  const auto is_later = [&](const Event& event) {
    return event.t <= max_t &&
           std::max(base + event.t, validator_.passed()) >= complete / microsecond;
  };
  const auto waiting = of_intervals() ? rest.end() : std::ranges::find_if(rest, is_later);
  added.excess = static_cast<std::size_t>(waiting - rest.begin());
  added.waiting = rest.subspan(added.excess);
  if (added.waiting.empty()) complete = end;
  reached_ = std::max(complete, reached_.value_or(complete));
  if (of_intervals()) intervals_.push_back({*start_, *reached_, events_.size()});
  return added;
}

/// Index of the first event, in the next window or later, that is not before `time`.
std::size_t WindowQueue::index_at(Nanoseconds time) const {
  const auto from = events_.begin() + static_cast<std::ptrdiff_t>(first_);
  const auto at =
      std::ranges::lower_bound(from, events_.end(), time / microsecond, {}, &AbsoluteEvent::t);
  return static_cast<std::size_t>(at - events_.begin());
}

WindowQueue::Window WindowQueue::window(Nanoseconds start, Nanoseconds end, std::size_t last) {
  returned_ = std::max(returned_, last);
  return {start, end, std::span(events_).subspan(first_, last - first_)};
}

std::optional<WindowQueue::Window> WindowQueue::next_by_time() {
  if (!start_ || *reached_ - *start_ < settings_.duration) return std::nullopt;
  const Nanoseconds start = *start_;
  const Nanoseconds end = start + settings_.duration;
  const auto found = window(start, end, index_at(end));
  validator_.pass(end / microsecond);
  start_ = start + settings_.hop(settings_.duration);
  first_ = index_at(*start_);
  return found;
}

std::optional<WindowQueue::Window> WindowQueue::next_by_count() {
  if (events_.size() - first_ < settings_.events) return std::nullopt;
  const std::size_t last = first_ + settings_.events;
  const auto found =
      window(events_[first_].t * microsecond, events_[last - 1].t * microsecond, last);
  first_ += settings_.hop(settings_.events);
  return found;
}

std::optional<WindowQueue::Window> WindowQueue::next_by_intervals() {
  if (intervals_.size() < settings_.intervals) return std::nullopt;
  const auto& last = intervals_[settings_.intervals - 1];
  const auto found = window(intervals_.front().start, last.end, last.last);
  for (std::size_t i = settings_.hop(settings_.intervals); i > 0; --i) {
    first_ = intervals_.front().last;
    intervals_.pop_front();
  }
  return found;
}

std::optional<WindowQueue::Window> WindowQueue::next() {
  if (settings_.events > 0) return next_by_count();
  return settings_.duration > 0 ? next_by_time() : next_by_intervals();
}

bool WindowQueue::is_open() const {
  if (settings_.events > 0) return first_ < events_.size();
  return settings_.duration > 0 ? start_.has_value() : !intervals_.empty();
}

std::optional<WindowQueue::Window> WindowQueue::finish() {
  if (returned_ == events_.size()) return std::nullopt;
  if (settings_.events > 0)
    return window(events_[first_].t * microsecond, events_.back().t * microsecond, events_.size());
  const Nanoseconds start = settings_.duration > 0 ? *start_ : intervals_.front().start;
  return window(start, *reached_, events_.size());
}

}  // namespace eventcamera
