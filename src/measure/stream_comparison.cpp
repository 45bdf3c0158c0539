// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/measure/stream_comparison.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace eventcamera {
namespace {

constexpr Microseconds max_distance = match_distances.back();
constexpr Microseconds no_match = std::numeric_limits<Microseconds>::max();

Microseconds distance_between(LastTime earlier, Microseconds later) {
  return earlier.is_known() ? later - earlier.value() : no_match;
}

}  // namespace

void RateCurve::extend_to(Microseconds end) {
  if (end <= covered_) return;
  while (bin_of(end - 1) >= max_bins) join_bins();
  bins_.resize(std::max(bins_.size(), bin_of(end - 1) + 1));
  covered_ = start_ + length_ * static_cast<Microseconds>(bins_.size());
}

void RateCurve::join_bins() {
  const std::size_t joined = (bins_.size() + 1) / 2;
  bins_.resize(2 * joined);
  for (std::size_t i = 0; i < joined; ++i)
    for (const auto role : both_roles) bins_[i][role] = bins_[2 * i][role] + bins_[2 * i + 1][role];
  bins_.resize(joined);
  length_ *= 2;
}

void RateCorrelation::extend_to(Microseconds end) {
  constexpr Microseconds length = 1000;
  if (end <= end_) return;
  const Microseconds bins = (end - end_ + length - 1) / length;
  if (has_bin_) add_bin(sums_, last_);
  sums_.bins += static_cast<double>(bins - 1);
  last_ = {};
  has_bin_ = true;
  end_ += bins * length;
}

void RateCorrelation::add_bin(Sums& sums, const PerRole<double>& bin) {
  ++sums.bins;
  sums.product += bin[StreamRole::reference] * bin[StreamRole::candidate];
  for (const auto role : both_roles) {
    sums.counts[role] += bin[role];
    sums.squares[role] += bin[role] * bin[role];
  }
}

double RateCorrelation::value() const {
  auto sums = sums_;
  if (has_bin_) add_bin(sums, last_);
  const double reference = sums.counts[StreamRole::reference];
  const double candidate = sums.counts[StreamRole::candidate];
  const double variances =
      (sums.bins * sums.squares[StreamRole::reference] - reference * reference) *
      (sums.bins * sums.squares[StreamRole::candidate] - candidate * candidate);
  if (!(variances > 0)) return 0;
  return (sums.bins * sums.product - reference * candidate) / std::sqrt(variances);
}

EventMatcher::EventMatcher(int width, int height) {
  for (const auto role : both_roles)
    for (auto& pixels : streams_[role].pixels) pixels = Image<Pixel>(width, height, 1);
}

void EventMatcher::count(Stream& stream, Microseconds distance, Microseconds known_distance) {
  for (std::size_t i = 0; i < match_distances.size(); ++i)
    if (distance <= match_distances[i] && known_distance > match_distances[i]) ++stream.matched[i];
}

void EventMatcher::match_waiting(Stream& stream, Pixel& pixel, Microseconds time) {
  for (Number number = pixel.waiting; number >= stream.first;) {
    const auto& waiting = stream.waiting[number - stream.first];
    const auto distance = time - waiting.time;
    if (distance < waiting.nearest) count(stream, distance, waiting.nearest);
    number = waiting.before;
  }
  pixel.waiting = 0;
}

void EventMatcher::wait(Stream& stream, Pixel& pixel, const Waiting& waiting) {
  while (!stream.waiting.empty() && (waiting.time - stream.waiting.front().time > max_distance ||
                                     stream.waiting.size() == max_waiting)) {
    stream.waiting.pop_front();
    ++stream.first;
  }
  stream.waiting.push_back(waiting);
  pixel.waiting = stream.first + stream.waiting.size() - 1;
}

void EventMatcher::add(StreamRole role, const AbsoluteEvent& event) {
  const auto polarity = static_cast<std::size_t>(event.polarity());
  auto& others = streams_[other(role)];
  auto& around = others.pixels[polarity];
  LastTime last;
  for (int y = event.y() - 1; y <= event.y() + 1; ++y) {
    for (int x = event.x - 1; x <= event.x + 1; ++x) {
      auto& pixel = around.at(x, y);
      last = std::max(last, pixel.last);
      if (pixel.waiting != 0) match_waiting(others, pixel, event.t);
    }
  }
  auto& own = streams_[role];
  auto& pixel = own.pixels[polarity].at(event.x, event.y());
  const auto nearest = distance_between(last, event.t);
  count(own, nearest, no_match);
  if (nearest > match_distances.front())
    wait(own, pixel, {.time = event.t, .nearest = nearest, .before = pixel.waiting});
  pixel.last = event.t;
}

StreamComparison::StreamComparison(int width, int height)
    : arriving_({.validator = EventValidator(width, height)},
                {.validator = EventValidator(width, height)}),
      last_times_(LastTimes(width, height), LastTimes(width, height)),
      statistics_(EventStatistics(width, height), EventStatistics(width, height)),
      matcher_(width, height) {}

StreamRole StreamComparison::behind() const {
  const auto& reference = arriving_[StreamRole::reference];
  const auto& candidate = arriving_[StreamRole::candidate];
  if (!reference.start) return StreamRole::reference;
  if (!candidate.start) return StreamRole::candidate;
  return candidate.end < reference.end ? StreamRole::candidate : StreamRole::reference;
}

std::optional<Nanoseconds> StreamComparison::start() const {
  const auto& a = arriving_[StreamRole::reference].start;
  const auto& b = arriving_[StreamRole::candidate].start;
  return a && b ? std::optional(std::max(*a, *b)) : std::nullopt;
}

Nanoseconds StreamComparison::end() const {
  return std::min(arriving_[StreamRole::reference].end, arriving_[StreamRole::candidate].end);
}

std::size_t StreamComparison::add(StreamRole role, std::span<const Event> events, Nanoseconds start,
                                  Nanoseconds end) {
  auto& arriving = arriving_[role];
  if (!arriving.start) {
    arriving.start = start;
    arriving.end = start;
  }
  const std::size_t skipped = arriving.validator.take(
      events, start / 1000, [&](const AbsoluteEvent& event) { arriving.waiting.push_back(event); });
  arriving.end = std::max(arriving.end, end);
  if (this->start()) take_until(this->end() / 1000);
  return skipped;
}

void StreamComparison::take_until(Microseconds end) {
  const Microseconds begin = *start() / 1000;
  if (!std::exchange(begun_, true)) {
    rates_ = RateCurve(begin);
    rate_correlation_ = RateCorrelation(begin);
  }
  PerRole<std::span<const AbsoluteEvent>> due;
  for (const auto role : both_roles) {
    const auto waiting =
        std::span<const AbsoluteEvent>(arriving_[role].waiting).subspan(arriving_[role].taken);
    due[role] = waiting.first(static_cast<std::size_t>(
        std::ranges::upper_bound(waiting, end, {}, &AbsoluteEvent::t) - waiting.begin()));
  }
  for (const auto role : both_roles) arriving_[role].taken += due[role].size();
  auto& reference = due[StreamRole::reference];
  auto& candidate = due[StreamRole::candidate];
  while (!reference.empty() || !candidate.empty()) {
    const auto role =
        candidate.empty() || (!reference.empty() && reference.front().t <= candidate.front().t)
            ? StreamRole::reference
            : StreamRole::candidate;
    const auto& event = due[role].front();
    due[role] = due[role].subspan(1);
    if (event.t < begin) continue;
    statistics_[role].add(event, last_times_[role].take(event));
    matcher_.add(role, event);
    rates_.add(role, event.t);
    rate_correlation_.add(role, event.t);
  }
  for (const auto role : both_roles) {
    // Not in every call, because a long buffer may be processed in many short pieces.
    auto& waiting = arriving_[role].waiting;
    auto& taken = arriving_[role].taken;
    if (2 * taken < waiting.size()) continue;
    waiting.erase(waiting.begin(), waiting.begin() + static_cast<std::ptrdiff_t>(taken));
    taken = 0;
  }
  rates_.extend_to(end);
  rate_correlation_.extend_to(end);
  for (const auto role : both_roles) arriving_[role].validator.pass(end);
}

ComparisonFigures StreamComparison::figures() const {
  ComparisonFigures figures;
  if (!start() || end() <= *start()) return figures;
  figures.start = *start();
  figures.end = end();
  for (const auto role : both_roles) {
    auto& stream = figures.streams[role];
    stream = statistics_[role].figures(figures.end - figures.start);
    const auto& matched = matcher_.matched(role);
    for (std::size_t i = 0; stream.events > 0 && i < matched.size(); ++i)
      figures.match_shares[role][i] =
          static_cast<double>(matched[i]) / static_cast<double>(stream.events);
  }
  figures.rate_correlation = rate_correlation_.value();
  figures.interval_distance = statistics_[StreamRole::reference].intervals().distance_to(
      statistics_[StreamRole::candidate].intervals());
  figures.map_correlation = correlation(map(StreamRole::reference), map(StreamRole::candidate));
  return figures;
}

}  // namespace eventcamera
