// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/measure/stream_comparison.hpp"

#include <algorithm>
#include <utility>

namespace eventcamera {

StreamComparison::StreamComparison(int width, int height)
    : arriving_({.arrivals = Arrivals(width, height)}, {.arrivals = Arrivals(width, height)}),
      statistics_(EventStatistics(width, height), EventStatistics(width, height)),
      partners_(width, height) {}

Side StreamComparison::behind() const {
  const auto& reference = arriving_[Side::reference];
  const auto& candidate = arriving_[Side::candidate];
  if (!reference.start) return Side::reference;
  if (!candidate.start) return Side::candidate;
  return candidate.end < reference.end ? Side::candidate : Side::reference;
}

std::optional<Nanoseconds> StreamComparison::start() const {
  const auto& a = arriving_[Side::reference].start;
  const auto& b = arriving_[Side::candidate].start;
  return a && b ? std::optional(std::max(*a, *b)) : std::nullopt;
}

Nanoseconds StreamComparison::end() const {
  return std::min(arriving_[Side::reference].end, arriving_[Side::candidate].end);
}

std::size_t StreamComparison::add(Side side, std::span<const Event> events, Nanoseconds start,
                                  Nanoseconds end) {
  auto& arriving = arriving_[side];
  if (!arriving.start) {
    arriving.start = start;
    arriving.end = start;
  }
  const std::size_t left_out = arriving.arrivals.take(
      events, start / 1000, [&](const AbsoluteEvent& event) { arriving.waiting.push_back(event); });
  arriving.end = std::max(arriving.end, end);
  if (this->start()) take_until(this->end() / 1000);
  return left_out;
}

void StreamComparison::take_until(Microseconds end) {
  const Microseconds begin = *start() / 1000;
  if (!std::exchange(begun_, true)) rates_ = RateCurve(begin);
  OfSides<std::span<const AbsoluteEvent>> due;
  for (const auto side : both_sides) {
    const auto waiting =
        std::span<const AbsoluteEvent>(arriving_[side].waiting).subspan(arriving_[side].taken);
    due[side] = waiting.first(static_cast<std::size_t>(
        std::ranges::upper_bound(waiting, end, {}, &AbsoluteEvent::t) - waiting.begin()));
  }
  for (const auto side : both_sides) arriving_[side].taken += due[side].size();
  auto& reference = due[Side::reference];
  auto& candidate = due[Side::candidate];
  while (!reference.empty() || !candidate.empty()) {
    const auto side =
        candidate.empty() || (!reference.empty() && reference.front().t <= candidate.front().t)
            ? Side::reference
            : Side::candidate;
    const auto& event = due[side].front();
    due[side] = due[side].subspan(1);
    if (event.t <= begin) continue;
    statistics_[side].add(event);
    partners_.add(side, event);
    rates_.add(side, event.t);
  }
  for (const auto side : both_sides) {
    // Not each time: a long buffer may be taken in many short pieces.
    auto& waiting = arriving_[side].waiting;
    auto& taken = arriving_[side].taken;
    if (2 * taken < waiting.size()) continue;
    waiting.erase(waiting.begin(), waiting.begin() + static_cast<std::ptrdiff_t>(taken));
    taken = 0;
  }
  rates_.extend_to(end);
  for (const auto side : both_sides) arriving_[side].arrivals.pass(end);
}

ComparisonFigures StreamComparison::figures() const {
  ComparisonFigures figures;
  if (!start() || end() <= *start()) return figures;
  figures.start = *start();
  figures.end = end();
  for (const auto side : both_sides) {
    auto& stream = figures.streams[side];
    stream = statistics_[side].figures(figures.end - figures.start);
    const auto& partnered = partners_.partnered(side);
    for (std::size_t i = 0; stream.events > 0 && i < partnered.size(); ++i)
      figures.partner_shares[side][i] =
          static_cast<double>(partnered[i]) / static_cast<double>(stream.events);
  }
  figures.map_correlation = correlation(map(Side::reference), map(Side::candidate));
  return figures;
}

}  // namespace eventcamera
