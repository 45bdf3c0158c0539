// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/measure/partner_search.hpp"

#include <algorithm>
#include <limits>

namespace eventcamera {
namespace {

constexpr Microseconds farthest = partner_distances.back();
constexpr Microseconds nobody = std::numeric_limits<Microseconds>::max();
constexpr Microseconds never = std::numeric_limits<Microseconds>::min();

/// Times may lie as far apart as there is room for.
Microseconds distance_between(Microseconds earlier, Microseconds later) {
  if (earlier == never) return nobody;
  return later - earlier;
}

}  // namespace

PartnerSearch::PartnerSearch(int width, int height) {
  for (const auto side : both_sides) {
    for (auto& pixels : lanes_[side].pixels) {
      pixels = Image<Pixel>(width + 2, height + 2);
      for (int y = 0; y < height + 2; ++y)
        std::fill_n(pixels.row(y), width + 2, Pixel{.last = never, .waiting = 0});
    }
  }
}

void PartnerSearch::count(Lane& lane, Microseconds distance, Microseconds known_distance) {
  for (std::size_t i = 0; i < partner_distances.size(); ++i)
    if (distance <= partner_distances[i] && known_distance > partner_distances[i])
      ++lane.partnered[i];
}

void PartnerSearch::meet(Lane& lane, Pixel& pixel, Microseconds time) {
  for (Ticket ticket = pixel.waiting; ticket >= lane.first;) {
    const auto& waiting = lane.waiting[ticket - lane.first];
    const auto distance = time - waiting.time;
    if (distance < waiting.nearest) count(lane, distance, waiting.nearest);
    ticket = waiting.before;
  }
  pixel.waiting = 0;
}

void PartnerSearch::wait(Lane& lane, Pixel& pixel, const Waiting& waiting) {
  while (!lane.waiting.empty() && (waiting.time - lane.waiting.front().time > farthest ||
                                   lane.waiting.size() == max_waiting)) {
    lane.waiting.pop_front();
    ++lane.first;
  }
  lane.waiting.push_back(waiting);
  pixel.waiting = lane.first + lane.waiting.size() - 1;
}

void PartnerSearch::add(Side side, const AbsoluteEvent& event) {
  const auto polarity = static_cast<std::size_t>(event.polarity());
  auto& others = lanes_[other(side)];
  auto& around = others.pixels[polarity];
  auto last = never;
  for (int y = event.y(); y < event.y() + 3; ++y) {
    for (auto* pixel = &around.at(event.x, y); pixel != &around.at(event.x, y) + 3; ++pixel) {
      last = std::max(last, pixel->last);
      if (pixel->waiting != 0) meet(others, *pixel, event.t);
    }
  }
  auto& own = lanes_[side];
  auto& pixel = own.pixels[polarity].at(event.x + 1, event.y() + 1);
  const auto nearest = distance_between(last, event.t);
  count(own, nearest, nobody);
  if (nearest > partner_distances.front())
    wait(own, pixel, {.time = event.t, .nearest = nearest, .before = pixel.waiting});
  pixel.last = event.t;
}

}  // namespace eventcamera
