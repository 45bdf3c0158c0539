// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "src/core/sensor_size.hpp"
#include "src/flow/lucas_kanade/point_tracker.hpp"

namespace eventcamera {

/// Displacement in one step, in 1/65536 of a pixel: up to max_side. All arithmetic after the
/// conversion from float is integer, so results are the same on every processor.
using Motion = std::int32_t;

/// The flow of an interval (pixels) divided by its steps. NaN counts as 0; flows are clamped to
/// max_side.
inline Motion motion_per_step(float flow, int steps) {
  if (!(flow == flow)) return 0;
  constexpr float max_length = max_side;
  return static_cast<Motion>(std::lrint(std::clamp(flow, -max_length, max_length) *
                                        (65536.0F / static_cast<float>(steps))));
}

/// Position of a pixel after j steps from p, rounded to whole pixels.
inline int moved(int p, Motion motion, int j) {
  return static_cast<int>(
      ((static_cast<std::int64_t>(p) << 16) + static_cast<std::int64_t>(motion) * j + (1 << 15)) >>
      16);
}

/// A tracked pixel that stays within the frame through all steps of an interval.
struct MovingPoint {
  Point start;
  Motion dx;
  Motion dy;

  /// Position after j steps, rounded to a pixel.
  Point at(int j) const { return {moved(start.x, dx, j), moved(start.y, dy, j)}; }
};

/// Returns the motion along a track; none if the track was lost or leaves the frame.
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
