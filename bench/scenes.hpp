// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "src/core/image.hpp"
#include "src/core/step_times.hpp"

/// What the methods are timed on.
namespace bench {

using Picture = eventcamera::Image<std::uint8_t>;
/// Consecutive frames.
using Clip = std::vector<Picture>;

inline constexpr eventcamera::Nanoseconds frame_time = 40'000'000;

struct Scene {
  std::string name;
  std::vector<Clip> clips;
  int interpolated_frames;
};

/// Two recorded videos, where $SHARED_DATA has them, and a ball that flies. With `few_frames` the
/// clips are as short as can be.
std::vector<Scene> scenes(bool few_frames);

/// A textured patch that moves before a still texture; `share` is that of the picture's area.
Clip moving_patch(int width, int height, double share, int count);

}  // namespace bench
