// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>

#include "src/core/image.hpp"
#include "src/flow/dense_flow.hpp"

namespace eventcamera {

/// Range of the flow in a part of a frame, extended to include 0; pixels.
struct FlowRange {
  struct Axis {
    float min;
    float max;

    float max_length() const { return std::max(max, -min); }
  };
  Axis x;
  Axis y;

  float max_length() const { return std::max(x.max_length(), y.max_length()); }
};

/// Returns the range of the flow in a box within the frame. NaN counts as 0.
FlowRange flow_range(const ImageView<Flow>& flow, const Box& box);

}  // namespace eventcamera
