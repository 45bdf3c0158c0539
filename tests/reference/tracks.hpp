// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>

#include "src/flow/fixed_point.hpp"
#include "src/flow/lucas_kanade/point_tracker.hpp"

namespace eventcamera::reference {

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
