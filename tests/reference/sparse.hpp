// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdlib>
#include <span>

#include "tests/reference/differences.hpp"

namespace eventcamera::reference {

/// The pixels where |now - last| exceeds the threshold, in raster order.
template <class Pixel>
std::vector<Point> changed(const Image<Pixel>& last, const Image<Pixel>& now, int threshold) {
  std::vector<Point> points;
  for (int y = 0; y < now.height(); ++y)
    for (int x = 0; x < now.width(); ++x)
      if (std::abs(now.at(x, y) - last.at(x, y)) > threshold) points.push_back({x, y});
  return points;
}

/// `points` are changed() at the smaller threshold, `tracks` their tracks. At each step a tracked
/// pixel uncovers the background from `now` where it was, and covers the pixel that it has moved
/// to.
template <class Pixel>
std::vector<Event> sparse(const Image<Pixel>& last, const Image<Pixel>& now,
                          std::span<const Point> points, std::span<const Track> tracks,
                          const StepTimes& steps, const Thresholds& thresholds) {
  const int m = steps.count();
  Sequence<Pixel> sequence;
  for (int j = 0; j < m; ++j) {
    auto between = last;
    const auto for_each_tracked = [&](auto&& visit) {
      for (std::size_t i = 0; i < points.size(); ++i) {
        const Point end = moved_point(points[i], tracks[i].flow, m, m);
        if (tracks[i].found && inside(end, now.width(), now.height()))
          visit(points[i], moved_point(points[i], tracks[i].flow, j, m));
      }
    };
    for_each_tracked([&](const Point& p, const Point& to) {
      if (p.x != to.x || p.y != to.y) between.at(p.x, p.y) = now.at(p.x, p.y);
    });
    for_each_tracked(
        [&](const Point& p, const Point& to) { between.at(to.x, to.y) = last.at(p.x, p.y); });
    sequence.push_back(between);
  }
  sequence.push_back(now);
  return differences(sequence, steps, thresholds);
}

}  // namespace eventcamera::reference
