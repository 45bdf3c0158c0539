// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/filter/event_merge.hpp"

#include <algorithm>

namespace eventcamera {
namespace {

/// Maximum length of an interval, whose times fit into the 32 bits of an event.
constexpr Microseconds max_length = max_interval / 1000;

/// Pauses up to this are rounding errors of the inputs' times.
constexpr Microseconds rounding = 1;

}  // namespace

InvalidEvents MergeInput::load(std::span<const Event> events, std::span<const Label> labels,
                               SensorSize sensor, Microseconds length) {
  events_.assign(events.begin(), events.end());
  labels_.assign(labels.begin(), labels.end());
  InvalidEvents invalid;
  const auto valid = keep_valid({events_, labels_}, sensor,
                                static_cast<std::uint32_t>(std::min(length, max_length)), invalid);
  events_.resize(valid.events.size());
  labels_.resize(valid.labels.size());
  next_ = 0;
  length_ = length;
  loaded_ = true;
  return invalid;
}

void MergeInput::place(Microseconds start, int x, int y) {
  start_ = start;
  x_ = x;
  y_ = y;
}

void MergeInput::unload() {
  events_.clear();
  labels_.clear();
  next_ = 0;
  loaded_ = false;
}

Microseconds MergeInput::end_of_part(Microseconds end) const {
  return this->end() > end ? end : end + 1;
}

std::size_t MergeInput::first_at(Microseconds time) const {
  const auto begin = events_.begin() + static_cast<std::ptrdiff_t>(next_);
  const auto found = std::lower_bound(
      begin, events_.end(), time,
      [this](const Event& event, Microseconds limit) { return start_ + event.t < limit; });
  return static_cast<std::size_t>(found - events_.begin());
}

MergedInterval EventMerger::next(Inputs inputs) {
  const auto start_of = [](const MergeInput* input) { return input->start(); };
  const auto first_start = start_of(*std::ranges::min_element(inputs, {}, start_of));
  MergedInterval interval;
  interval.start = position_.value_or(first_start);
  interval.end = (*std::ranges::min_element(inputs, {}, &MergeInput::end))->end();
  interval.end = std::max(interval.end, interval.start);

  std::optional<Microseconds> first_event;
  for (auto* input : inputs) {
    const auto first = input->first_at(interval.start);
    interval.late += first - input->next_;
    input->next_ = first;
    if (!input->has_event_before(input->end_of_part(interval.end))) continue;
    first_event = std::min(first_event.value_or(input->next_time()), input->next_time());
  }
  if (first_event) {
    auto quiet_until = first_start > interval.start + rounding ? first_start : interval.start;
    if (interval.end - quiet_until > max_length) quiet_until = *first_event;
    if (quiet_until > interval.start) {
      interval.end = quiet_until;
      first_event.reset();
    }
  }
  if (first_event) {
    interval.end = std::min(interval.end, interval.start + max_length);
    for (const auto* input : inputs) {
      const auto count = input->first_at(input->end_of_part(interval.end)) - input->next_;
      interval.events += count;
      interval.labelled |= count > 0 && !input->labels_.empty();
    }
  }
  position_ = interval.end;
  return interval;
}

bool EventMerger::goes_back(const MergeInput& input) const {
  return position_ && input.start() + rounding < *position_;
}

void EventMerger::merge(Inputs inputs, const MergedInterval& interval, LabelledEvents out) {
  for (std::size_t written = 0; written < interval.events;) {
    // The next event, and the time of the next one of another input.
    MergeInput* first = nullptr;
    Microseconds other = interval.end + 1;
    for (auto* input : inputs) {
      if (!input->has_event_before(input->end_of_part(interval.end))) continue;
      const auto time = input->next_time();
      if (first == nullptr || time < first->next_time()) {
        if (first != nullptr) other = std::min(other, first->next_time());
        first = input;
      } else {
        other = std::min(other, time);
      }
    }
    if (first == nullptr) return;
    // All events of one microsecond of an input precede the events of later inputs.
    const auto until =
        std::min(std::max(other, first->next_time() + 1), first->end_of_part(interval.end)) -
        first->start_;
    const auto delay = static_cast<std::uint32_t>(first->start_ - interval.start);
    const auto run = written;
    const auto from = first->next_;
    auto& next = first->next_;
    do {
      const Event& event = first->events_[next++];
      // The polarity stays: rows are below 2^15.
      out.events[written++] = {event.t + delay, static_cast<std::uint16_t>(event.x + first->x_),
                               static_cast<std::uint16_t>(event.y_p + first->y_)};
    } while (next < first->events_.size() && first->events_[next].t < until);
    if (!interval.labelled) continue;
    const auto labels = out.labels.subspan(run, written - run);
    if (first->labels_.empty())
      std::ranges::fill(labels, Label{});
    else
      std::copy_n(first->labels_.begin() + static_cast<std::ptrdiff_t>(from), labels.size(),
                  labels.begin());
  }
}

}  // namespace eventcamera
