// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/unsettled_events.hpp"

#include <utility>

namespace eventcamera {

namespace {

constexpr std::size_t max_run = std::size_t{1} << 16;
/// A first event by itself is stray if it lies this far before at least so many others.
constexpr Microseconds max_pause_after_first = 1'000'000;
constexpr std::size_t many = 64;

}  // namespace

bool UnsettledEvents::is_near(Microseconds t, const Events& events) {
  return !events.empty() && t >= events.front().t - settled && t <= events.back().t + settled;
}

bool UnsettledEvents::is_long(const Events& events) {
  return events.back().t - events.front().t >= settled || events.size() >= max_run;
}

void UnsettledEvents::settle(Events& events) {
  right_.insert(right_.end(), events.begin(), events.end());
  events.clear();
}

void UnsettledEvents::drop(Events& events) {
  stray_ += events.size();
  events.clear();
}

void UnsettledEvents::drop() {
  drop(first_);
  drop(second_);
}

std::span<const AbsoluteEvent> UnsettledEvents::push(const AbsoluteEvent& event, bool is_start) {
  right_.clear();
  if (first_.empty() || is_near(event.t, first_)) {
    drop(second_);
    first_.push_back(event);
    if (is_long(first_)) settle(first_);
    return right_;
  }
  if (!second_.empty() && !is_near(event.t, second_)) {
    const bool is_later = second_.front().t > first_.back().t;
    const bool goes_on = event.t > second_.back().t && (is_later || event.t < first_.front().t);
    if (goes_on) {
      is_later ? settle(first_) : drop(first_);
      std::swap(first_, second_);
    } else {
      drop(second_);
    }
  }
  second_.push_back(event);
  if (!is_long(second_)) return right_;
  const auto pause = second_.front().t - first_.front().t;
  const bool begins_with_stray = is_start && first_.size() == 1 && second_.size() >= many &&
                                 pause > max_pause_after_first && right_.empty();
  pause < 0 || begins_with_stray ? drop(first_) : settle(first_);
  settle(second_);
  return right_;
}

std::span<const AbsoluteEvent> UnsettledEvents::settle_before(Microseconds t) {
  right_.clear();
  if (empty()) return right_;
  if (!second_.empty() && second_.front().t < t) return finish();
  if (first_.front().t < t) {
    settle(first_);
    std::swap(first_, second_);
  }
  return right_;
}

std::span<const AbsoluteEvent> UnsettledEvents::finish() {
  right_.clear();
  const bool falls = !second_.empty() && second_.front().t < first_.front().t;
  if (falls) drop(first_.size() > second_.size() ? second_ : first_);
  settle(first_);
  settle(second_);
  return right_;
}

}  // namespace eventcamera
