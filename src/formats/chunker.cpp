// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/chunker.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <numeric>
#include <utility>

#include "src/core/interval_times.hpp"

namespace eventcamera {

namespace {

constexpr std::size_t max_run = std::size_t{1} << 16;
/// A single first event is stray if it precedes at least this many others by this much.
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

/// Events added at once.
static constexpr std::size_t block_size = 512;

Chunker::Chunker(Microseconds length, Microseconds start, Microseconds origin)
    : length_(length), first_(start), origin_(origin), start_(start) {}

void Chunker::push(std::span<const AbsoluteEvent> events) {
  paused_ &= events.empty();
  // Fast path: nearly always the events are in order and can be added in blocks.
  while (!events.empty()) {
    const auto kept = keep_sorted(events.first(std::min(events.size(), block_size)));
    if (kept == 0) break;
    events = events.subspan(kept);
  }
  for (const auto& event : events) place(event);
}

/// Keeps the events up to the end of their cell if they are sorted. Returns their number.
std::size_t Chunker::keep_sorted(std::span<const AbsoluteEvent> events) {
  const auto soon = [this](const AbsoluteEvent& event) { return event.t <= latest_ + settled; };
  if (!unsettled_.empty() || latest_ == never || events.front().t < std::max(latest_, start_) ||
      !soon(events.front()) || !soon(events.back()))
    return 0;
  auto& cell = cell_of(events.front().t);
  if (events.back().t >= cell.end)
    events = {events.begin(), std::ranges::partition_point(
                                  events, [&](const auto& event) { return event.t < cell.end; })};
  std::array<Event, block_size> block;
  if (!to_interval_times(cell.start, latest_, events, block.data()))
    return 0;  // the cell is not left empty: place() keeps the first event
  cell.events.insert(cell.events.end(), block.begin(), block.begin() + events.size());
  if (keeps_labels_) std::ranges::transform(events, std::back_inserter(cell.labels), label_of);
  latest_ = events.back().t;
  waiting_ += events.size();
  rows_ += events.size();
  return events.size();
}

void Chunker::place(const AbsoluteEvent& event) {
  ++rows_;
  if (!is_time(event.t)) {
    ++stray_;
    note_dropped();
    return;
  }
  const bool goes_on =
      latest_ != never && event.t <= latest_ + settled && event.t >= latest_ - settled;
  if (goes_on && !unsettled_.is_near(event.t)) unsettled_.drop();
  const bool is_far = latest_ == never || event.t > latest_ + settled;
  if (unsettled_.empty() && first_ && event.t < *first_)
    drop_early(event);
  else if (!unsettled_.empty() || is_far)
    keep_all(unsettled_.push(event, !first_));
  else
    keep(event);
  note_dropped();
}

/// Checks whether the events are far out of order.
void Chunker::note_dropped() {
  constexpr std::uint64_t always_tolerated = 100;
  const auto [late, stray] = dropped();
  if (late + stray == 0) return;
  if (first_dropped_ == 0) first_dropped_ = rows_;
  if (!disorder_ && late + stray > always_tolerated && (late + stray) * 100 > rows_)
    disorder_ = {first_dropped_, late + stray, rows_};
}

std::optional<Chunker::Disorder> Chunker::disorder() const {
  const auto [late, stray] = dropped();
  if (!disorder_ && finished_ && (late + stray) * 100 > rows_)
    return Disorder{first_dropped_, late + stray, rows_};
  return disorder_;
}

/// Drops an event that precedes the next interval.
void Chunker::drop_early(const AbsoluteEvent& event) {
  const bool is_ignored = origin_ && event.t >= *origin_ && event.t < *first_;
  late_ += static_cast<std::uint64_t>(!is_ignored);
}

void Chunker::keep(const AbsoluteEvent& event) {
  // An interval that is over counts as returned, whenever next() is called.
  const auto over = due();
  if (event.t < start_ || (event.t < over && event.t < grid_before(over))) return drop_early(event);
  auto& cell = cell_of(event.t);
  const auto t = static_cast<std::uint32_t>(event.t - cell.start);
  cell.is_sorted &= cell.events.empty() || t >= cell.events.back().t;
  cell.events.push_back({t, event.x, event.y_p});
  if (keeps_labels_) cell.labels.push_back(label_of(event));
  ++waiting_;
  latest_ = std::max(latest_, event.t);
}

void Chunker::keep_all(std::span<const AbsoluteEvent> events) {
  if (!first_ && !events.empty()) {
    first_ = std::ranges::min_element(events, {}, &AbsoluteEvent::t)->t;
    start_ = *first_;
  }
  for (const auto& event : events) keep(event);
}

void Chunker::advance_to(Microseconds t) {
  const auto reached = std::max(reached_, std::clamp(t, -max_time, max_time));
  keep_all(unsettled_.settle_before(reached + settled));
  reached_ = reached;
}

void Chunker::pause(Microseconds t) {
  keep_all(unsettled_.settle_before(t));
  paused_ = true;
}

void Chunker::finish() {
  keep_all(unsettled_.finish());
  finished_ = true;
  note_dropped();
}

/// Earlier events may be dropped.
Microseconds Chunker::due() const {
  return latest_ == never ? reached_ : std::max(reached_, latest_ - settled);
}

/// The cell of a time that was not returned yet.
Chunker::Cell& Chunker::cell_of(Microseconds t) {
  // Nearly always the last one.
  auto after = cells_.end();
  while (after != cells_.begin() && std::prev(after)->start > t) --after;
  if (after != cells_.begin() && t < std::prev(after)->end) return *std::prev(after);
  const auto on_grid = grid_before(t);
  const auto made = cells_.insert(after, {std::max(on_grid, start_), on_grid + length_, {}, {}});
  if (!spare_.empty()) {
    made->events = std::move(spare_.back());
    spare_.pop_back();
    spare_capacity_ -= made->events.capacity();
  }
  return *made;
}

std::optional<Chunker::Interval> Chunker::next() {
  if (!first_) return std::nullopt;
  auto due = this->due();
  const auto end = grid_before(start_) + length_;
  if (finished_) {
    if (waiting_ == 0) return std::nullopt;
    due = latest_ + 1;  // the last interval ends with the last event
  } else if (paused_ && waiting_ > 0) {
    due = std::max(due, latest_);
  } else if (end > due && waiting_ < max_events) {
    return std::nullopt;
  }
  if (end > due) {
    const auto cut = finished_ || paused_ ? due : std::min(end, middle());
    return cut > start_ ? interval_until(cut) : part_of(paused_ ? waiting_ : waiting_ / 2);
  }
  const auto silent_until = grid_before(cells_.empty() ? due : std::min(due, cells_.front().start));
  return interval_until(std::max(end, silent_until));
}

/// Where to cut while too many events wait: in the first cell if it has most of them.
Microseconds Chunker::middle() {
  auto& cell = cells_.front();
  const auto half = waiting_ / 2;
  if (cell.events.size() <= half) return cell.end;
  sort(cell);
  return cell.start + cell.events[half].t;
}

void Chunker::sort(Cell& cell) {
  if (std::exchange(cell.is_sorted, true)) return;
  if (!cell.labels.empty()) {
    std::vector<std::size_t> order(cell.labels.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return cell.events[i].t; });
    const auto labels = std::exchange(cell.labels, {});
    for (const auto i : order) cell.labels.push_back(labels[i]);
  }
  std::ranges::stable_sort(cell.events, {}, &Event::t);
}

Chunker::Interval Chunker::interval_until(Microseconds end) {
  Interval interval{start_, end - start_, {}, {}};
  start_ = end;
  if (cells_.empty() || cells_.front().start >= end) return interval;
  auto& cell = cells_.front();
  sort(cell);
  const auto later = std::ranges::partition_point(
      cell.events, [&](const Event& event) { return cell.start + event.t < end; });
  const auto count = static_cast<std::size_t>(later - cell.events.begin());
  for (auto& event : std::span(later, cell.events.end()))  // a cut in the middle
    event.t -= static_cast<std::uint32_t>(end - cell.start);
  cell.start = end;
  return_first(count);
  interval.events = returned_;
  interval.labels = returned_labels_;
  return interval;
}

/// The first events of a single time, of which more may follow: an interval without a duration.
Chunker::Interval Chunker::part_of(std::size_t count) {
  return_first(count);
  return {start_, 0, returned_, returned_labels_};
}

/// Moves the items from `count` on to `rest`.
template <class Item>
static void split(std::vector<Item>& items, std::size_t count, std::vector<Item>& rest) {
  const auto end = items.begin() + static_cast<std::ptrdiff_t>(std::min(count, items.size()));
  rest.assign(end, items.end());
  items.erase(end, items.end());
}

/// Moves the first events of the first cell to `returned_`. The others stay, in the memory of those
/// returned before.
void Chunker::return_first(std::size_t count) {
  auto& cell = cells_.front();
  std::swap(cell.events, returned_);
  std::swap(cell.labels, returned_labels_);
  split(returned_, count, cell.events);
  split(returned_labels_, count, cell.labels);
  waiting_ -= count;
  if (!cell.events.empty()) return;
  if (spare_capacity_ + cell.events.capacity() <= max_spare) {
    spare_capacity_ += cell.events.capacity();
    spare_.push_back(std::move(cell.events));
  }
  cells_.pop_front();
}

}  // namespace eventcamera
