// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace eventcamera {

/// Widest and tallest picture whose positions, and every flow within it, fit into a Motion.
inline constexpr int max_side = 16384;

/// How far something moves in one step, in 1/65536 of a pixel. A flow becomes a Motion once; what
/// follows is integer arithmetic, the same on every processor.
using Motion = std::int32_t;

/// The flow of a whole interval (pixels), shared out evenly over its steps. A flow that is no
/// number stands still; one longer than any picture is cut.
inline Motion motion_per_step(float flow, int steps) {
  if (!(flow == flow)) return 0;
  constexpr float longest = max_side;
  return static_cast<Motion>(
      std::lrint(std::clamp(flow, -longest, longest) * (65536.0F / static_cast<float>(steps))));
}

/// Where a pixel at p stands after j steps, rounded to whole pixels.
inline int moved(int p, Motion motion, int j) {
  return static_cast<int>(
      ((static_cast<std::int64_t>(p) << 16) + static_cast<std::int64_t>(motion) * j + (1 << 15)) >>
      16);
}

}  // namespace eventcamera
