// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>

#include "src/flow/fixed_point.hpp"
#include "src/flow/lucas_kanade/point_tracker.hpp"

namespace eventcamera {

/// A tracked pixel on its way through the steps of an interval, always within the picture.
struct MovingPoint {
  Point start;
  Motion dx;
  Motion dy;

  /// Where it stands after j steps, rounded to a pixel.
  Point at(int j) const { return {moved(start.x, dx, j), moved(start.y, dy, j)}; }
};

/// A tracked pixel set moving; none where its track was lost or leaves the picture.
inline std::optional<MovingPoint> moving_point(const Point& start, const Track& track, int steps,
                                               int width, int height) {
  if (!track.found) return std::nullopt;
  const MovingPoint point{start, motion_per_step(track.flow.x, steps),
                          motion_per_step(track.flow.y, steps)};
  const Point end = point.at(steps);
  if (end.x < 0 || end.x >= width || end.y < 0 || end.y >= height) return std::nullopt;
  return point;
}

}  // namespace eventcamera
