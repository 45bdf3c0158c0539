// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <type_traits>

#include "src/core/image.hpp"
#include "src/core/sensor_size.hpp"

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

/// How the frame I(a) between I(i-1) and I(i), 0 < a < 1, is sampled along the flow F.
enum class Interpolation {
  forward,  ///< I(i-1)(x - a F(x))
  blend,    ///< (1 - a) I(i-1)(x - a F(x)) + a I(i)(x + (1 - a) F(x))
};

/// Bilinear sample of an image at (x, y), in 1/65536 of a pixel, rounded to 1/64; the border is
/// replicated. The result is exact, in 1/4096 of a grey level.
template <class Pixel>
std::int32_t sample(const ImageView<Pixel>& image, std::int32_t x, std::int32_t y) {
  const int qx = std::clamp((x + 512) >> 10, 0, (image.width - 1) * 64);
  const int qy = std::clamp((y + 512) >> 10, 0, (image.height - 1) * 64);
  const int x0 = qx >> 6;
  const int y0 = qy >> 6;
  const int x1 = std::min(x0 + 1, image.width - 1);
  const Pixel* upper = image.row(y0);
  const Pixel* lower = image.row(std::min(y0 + 1, image.height - 1));
  const int right = qx & 63;
  const int down = qy & 63;
  return (upper[x0] * (64 - right) + upper[x1] * right) * (64 - down) +
         (lower[x0] * (64 - right) + lower[x1] * right) * down;
}

/// Weight of the later frame in step j of a blend, in 1/256.
inline int blend_weight(int j, int steps) {
  return (j * 256 + steps / 2) / steps;
}

/// Pixels of the interpolated frames between two frames.
template <class Pixel>
struct Warp {
  ImageView<Pixel> last;
  ImageView<Pixel> now;
  int steps;

  /// Pixel (x, y) of step j = 1 ... steps - 1, moving by (dx, dy) per step; rounded to a grey
  /// level.
  template <Interpolation interpolation>
  Pixel at(int x, int y, Motion dx, Motion dy, int j) const {
    const std::int32_t px = x << 16;
    const std::int32_t py = y << 16;
    const std::int32_t from_last = sample(last, px - j * dx, py - j * dy);
    if constexpr (interpolation == Interpolation::forward) {
      return static_cast<Pixel>((from_last + 2048) >> 12);
    } else {
      using Sum = std::conditional_t<sizeof(Pixel) == 1, std::int32_t, std::int64_t>;
      const int left = steps - j;
      const std::int32_t from_now = sample(now, px + left * dx, py + left * dy);
      const int weight = blend_weight(j, steps);
      return static_cast<Pixel>(
          (Sum{from_last} * (256 - weight) + Sum{from_now} * weight + (1 << 19)) >> 20);
    }
  }
};

}  // namespace eventcamera
