// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "src/core/image.hpp"
#include "src/simulate/simulator.hpp"

/// Videos for timing the methods.
namespace bench {

using Frame = eventcamera::Image<std::uint8_t>;
/// Consecutive frames.
using Clip = std::vector<Frame>;

inline constexpr eventcamera::Nanoseconds frame_time = 40'000'000;

struct Scene {
  std::string name;
  std::vector<Clip> clips;
  int interpolated_frames;
};

/// Recorded videos, if $SHARED_DATA has them, and the ball. With `few_frames` the clips are as
/// short as possible.
std::vector<Scene> scenes(bool few_frames);

/// The recorded video from a moving car, at a size whose width is a multiple of 4; nothing if
/// $SHARED_DATA does not have it.
std::optional<Scene> driving(int width, int height, bool few_frames);

/// A ball of 40 pixels that flies over a static, textured image of 1280x720.
Clip ball(int count);

/// A textured patch that covers `share` of the frame and moves over a static texture.
Clip moving_patch(int width, int height, double share, int count);

/// Frame i of a clip played forwards and backwards forever.
template <class AnyFrame>
const AnyFrame& back_and_forth(const std::vector<AnyFrame>& clip, std::int64_t i) {
  const auto period = 2 * (static_cast<std::int64_t>(clip.size()) - 1);
  const auto at = i % period;
  return clip[static_cast<std::size_t>(std::min(at, period - at))];
}

}  // namespace bench
