// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/measure/stream_comparison.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace eventcamera {

namespace {

/// Correlation of two whole recordings from the correlation of two halves (Spearman-Brown).
double spearman_brown(double halves) {
  return 2 * std::max(halves, 0.0) / (1 + std::abs(halves));
}

}  // namespace

StreamSimilarity::StreamSimilarity(int width, int height)
    : last_times_(LastTimes(width, height), LastTimes(width, height)),
      statistics_(EventStatistics(width, height), EventStatistics(width, height)),
      matcher_(width, height) {}

void StreamSimilarity::add(StreamRole role, const AbsoluteEvent& event) {
  statistics_[role].add(event, last_times_[role].update(event));
  rates_.add(role, event.t);
  matcher_.add(role, event);
}

SimilarityFigures StreamSimilarity::figures() const {
  const auto& reference = statistics_[StreamRole::reference];
  const auto& candidate = statistics_[StreamRole::candidate];
  return {.map_correlation = correlation(reference.map(), candidate.map()),
          .rate_correlation = rates_.value(),
          .interval_distance = reference.intervals().distance_to(candidate.intervals()),
          .matches = {matcher_.figures(StreamRole::reference),
                      matcher_.figures(StreamRole::candidate)}};
}

CeilingFigures NoiseCeiling::figures() const {
  const auto halves = halves_.figures();
  CeilingFigures ceiling{.rate_correlation = spearman_brown(halves.rate_correlation),
                         .interval_distance = halves.interval_distance,
                         .matches = {}};
  const auto& first = halves.matches[StreamRole::reference];
  const auto& second = halves.matches[StreamRole::candidate];
  for (std::size_t i = 0; i < match_distances.size(); ++i) {
    const double missed = 1 - (first.shares[i] + second.shares[i]) / 2;
    ceiling.matches.shares[i] = 1 - missed * missed;
  }
  ceiling.matches.nearest_distance = (first.nearest_distance + second.nearest_distance) / 4;
  return ceiling;
}

StreamComparison::StreamComparison(int width, int height)
    : arriving_({.validator = EventValidator(width, height)},
                {.validator = EventValidator(width, height)}),
      similarity_(width, height),
      ceiling_(width, height) {}

StreamRole StreamComparison::behind() const {
  const auto& reference = arriving_[StreamRole::reference];
  const auto& candidate = arriving_[StreamRole::candidate];
  if (!reference.start) return StreamRole::reference;
  if (!candidate.start) return StreamRole::candidate;
  return candidate.end < reference.end ? StreamRole::candidate : StreamRole::reference;
}

std::optional<Nanoseconds> StreamComparison::end_of(StreamRole role) const {
  const auto& stream = arriving_[role];
  return stream.start ? std::optional(stream.end) : std::nullopt;
}

std::optional<Nanoseconds> StreamComparison::start() const {
  const auto& a = arriving_[StreamRole::reference].start;
  const auto& b = arriving_[StreamRole::candidate].start;
  return a && b ? std::optional(std::max(*a, *b)) : std::nullopt;
}

Nanoseconds StreamComparison::end() const {
  return std::min(arriving_[StreamRole::reference].end, arriving_[StreamRole::candidate].end);
}

InvalidEvents StreamComparison::add(StreamRole role, std::span<const Event> events,
                                    Microseconds base, Nanoseconds start, Nanoseconds end,
                                    std::span<const Label> labels) {
  auto& arriving = arriving_[role];
  if (!arriving.start) {
    arriving.start = start;
    arriving.end = start;
  }
  arriving.is_labelled |= !labels.empty();
  const auto skipped = arriving.validator.for_each_valid(
      events, base, end / 1000 - base,
      [&](const AbsoluteEvent& event) { arriving.waiting.push_back(event); }, labels);
  arriving.end = std::max(arriving.end, end);
  if (this->start()) move_until(this->end() / 1000);
  return skipped;
}

void StreamComparison::move_until(Microseconds end) {
  const Microseconds begin = *start() / 1000;
  if (!std::exchange(begun_, true)) {
    rates_ = RateCurve(begin);
    similarity_.begin(begin);
    ceiling_.begin(begin);
  }
  PerRole<std::span<const AbsoluteEvent>> due;
  for (const auto role : both_roles) {
    const auto waiting =
        std::span<const AbsoluteEvent>(arriving_[role].waiting).subspan(arriving_[role].processed);
    due[role] = waiting.first(static_cast<std::size_t>(
        std::ranges::upper_bound(waiting, end, {}, &AbsoluteEvent::t) - waiting.begin()));
  }
  for (const auto role : both_roles) arriving_[role].processed += due[role].size();
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
    similarity_.add(role, event);
    if (role == StreamRole::reference) ceiling_.add(event);
    rates_.add(role, event.t);
    if (arriving_[role].is_labelled) causes_[role].add(event.cause);
  }
  for (const auto role : both_roles) {
    // Not in every call, because a long buffer may be processed in many short pieces.
    auto& waiting = arriving_[role].waiting;
    auto& processed = arriving_[role].processed;
    if (2 * processed < waiting.size()) continue;
    waiting.erase(waiting.begin(), waiting.begin() + static_cast<std::ptrdiff_t>(processed));
    processed = 0;
  }
  rates_.extend_to(end);
  similarity_.extend_to(end);
  ceiling_.extend_to(end);
  for (const auto role : both_roles) arriving_[role].validator.pass(end);
}

ComparisonFigures StreamComparison::figures() const {
  ComparisonFigures figures;
  if (!start() || end() <= *start()) return figures;
  figures.start = *start();
  figures.end = end();
  for (const auto role : both_roles)
    figures.streams[role] = similarity_.statistics(role).figures(figures.end - figures.start);
  figures.similarity = similarity_.figures();
  figures.ceiling = ceiling_.figures();
  return figures;
}

}  // namespace eventcamera
