// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <vector>

#include "bench/plain/opencv.hpp"
#include "src/flow/fixed_point.hpp"

namespace plain {

/// A tracked pixel on its way through the steps of an interval.
struct MovingPoint {
  int x;
  int y;
  Motion dx;
  Motion dy;
  std::size_t index;  ///< among those that were tracked

  int x_at(int j) const { return moved(x, dx, j); }
  int y_at(int j) const { return moved(y, dy, j); }
};

/// Calls visit(MovingPoint) for each point whose track was found and stays in the picture.
template <class Visit>
void for_each_moving(const std::vector<cv::Point2f>& points, const Tracks& tracks, int steps,
                     const LumaFormat& format, const Visit& visit) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const cv::Point2f flow = tracks.ends[i] - points[i];
    if (tracks.found[i] == 0 || !std::isfinite(flow.x) || !std::isfinite(flow.y)) continue;
    const MovingPoint point{static_cast<int>(points[i].x), static_cast<int>(points[i].y),
                            motion_per_step(flow.x, steps), motion_per_step(flow.y, steps), i};
    const int x = point.x_at(steps);
    const int y = point.y_at(steps);
    if (x >= 0 && x < format.width && y >= 0 && y < format.height) visit(point);
  }
}

}  // namespace plain
