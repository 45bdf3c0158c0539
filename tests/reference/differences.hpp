// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "src/core/event.hpp"
#include "src/core/image.hpp"
#include "src/flow/lucas_kanade/point_tracker.hpp"
#include "src/simulate/simulator.hpp"
#include "src/simulate/warp.hpp"

/// Reference equations of the simulators, implemented literally: one frame after another, in plain
/// loops and double precision, which represents all their numbers exactly. Tests compare the
/// simulators to them, event by event.
namespace eventcamera::reference {

/// I(0), I(1/m) ... I(1).
template <class Pixel>
using Sequence = std::vector<Image<Pixel>>;

/// e_j(x) = ON where I(j) - I(j-1) > C+, OFF where I(j-1) - I(j) > C-, at the time of I(j).
template <class Pixel>
std::vector<Event> differences(const Sequence<Pixel>& sequence, const StepTimes& steps,
                               const Thresholds& thresholds) {
  std::vector<Event> events;
  for (int j = 1; j < static_cast<int>(sequence.size()); ++j) {
    const auto& before = sequence[static_cast<std::size_t>(j - 1)];
    const auto& now = sequence[static_cast<std::size_t>(j)];
    for (int y = 0; y < now.height(); ++y) {
      for (int x = 0; x < now.width(); ++x) {
        if (now.at(x, y) - before.at(x, y) > thresholds.positive)
          events.push_back(Event::at(x, y, steps.microseconds(j), Polarity::on));
        if (before.at(x, y) - now.at(x, y) > thresholds.negative)
          events.push_back(Event::at(x, y, steps.microseconds(j), Polarity::off));
      }
    }
  }
  return events;
}

/// Bounding box of the pixels where |now - last| exceeds the threshold.
template <class Pixel>
Box changed_box(const Image<Pixel>& last, const Image<Pixel>& now, int threshold) {
  Box box;
  for (int y = 0; y < now.height(); ++y) {
    for (int x = 0; x < now.width(); ++x) {
      if (std::abs(now.at(x, y) - last.at(x, y)) <= threshold) continue;
      if (box.empty()) box = {x, y, x + 1, y + 1};
      box = {std::min(box.left, x), box.top, std::max(box.right, x + 1), y + 1};
    }
  }
  return box;
}

/// p + j/m f, rounded.
inline Point moved_point(const Point& p, const Flow& f, int j, int m) {
  const auto along = [j, m](int start, float flow) {
    return static_cast<int>(std::floor(start + j * (motion_per_step(flow, m) / 65536.0) + 0.5));
  };
  return {along(p.x, f.x), along(p.y, f.y)};
}

inline bool inside(const Point& p, int width, int height) {
  return p.x >= 0 && p.x < width && p.y >= 0 && p.y < height;
}

}  // namespace eventcamera::reference
