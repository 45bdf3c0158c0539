// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/measure/event_matcher.hpp"

#include <algorithm>
#include <limits>

namespace eventcamera {
namespace {

constexpr Microseconds max_distance = match_distances.back();
constexpr Microseconds no_match = std::numeric_limits<Microseconds>::max();

Microseconds distance_between(LastTime earlier, Microseconds later) {
  return earlier.is_known() ? later - earlier.value() : no_match;
}

}  // namespace

EventMatcher::EventMatcher(int width, int height) {
  for (const auto role : both_roles)
    for (auto& pixels : streams_[role].pixels) pixels = Image<Pixel>(width, height, 1);
}

void EventMatcher::Stream::count(Microseconds distance) {
  ++events;
  distances += static_cast<std::uint64_t>(max_distance);
  reduce_distance(distance, no_match);
}

void EventMatcher::Stream::reduce_distance(Microseconds distance, Microseconds known_distance) {
  for (std::size_t i = 0; i < match_distances.size(); ++i)
    if (distance <= match_distances[i] && known_distance > match_distances[i]) ++matched[i];
  distances -= static_cast<std::uint64_t>(std::min(known_distance, max_distance) -
                                          std::min(distance, max_distance));
}

void EventMatcher::match_waiting(Stream& stream, Pixel& pixel, Microseconds time) {
  for (Number number = pixel.waiting; number >= stream.first;) {
    const auto& waiting = stream.waiting[number - stream.first];
    const auto distance = time - waiting.time;
    if (distance < waiting.nearest) stream.reduce_distance(distance, waiting.nearest);
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
  own.count(nearest);
  if (nearest > 0) wait(own, pixel, {.time = event.t, .nearest = nearest, .before = pixel.waiting});
  pixel.last = event.t;
}

MatchFigures EventMatcher::figures(StreamRole role) const {
  const auto& stream = streams_[role];
  MatchFigures figures;
  if (stream.events == 0) return figures;
  const auto events = static_cast<double>(stream.events);
  for (std::size_t i = 0; i < match_distances.size(); ++i)
    figures.shares[i] = static_cast<double>(stream.matched[i]) / events;
  figures.nearest_distance = static_cast<double>(stream.distances) / events;
  return figures;
}

}  // namespace eventcamera
