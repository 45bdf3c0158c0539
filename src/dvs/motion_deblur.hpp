// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"
#include "src/flow/dense_flow.hpp"

namespace eventcamera {

/// Estimates the sharp light L in the middle of a long exposure from the motion and the frame I,
/// the mean over the exposure: Richardson-Lucy iterations of twice the usual step,
///   L = L * mean(I / mean(L))^2, at first L = I,
/// where mean() is taken along the motion of each pixel. At the fixed point, mean(L) = I.
///
/// Blocks of 8x1 pixels share their motion. It is sampled once per pixel along its longer axis,
/// with linear interpolation across; motion below a pixel counts as none. The border is replicated.
class MotionDeblur {
 public:
  static constexpr int block = 8;
  static constexpr int iterations = 10;
  static constexpr int max_length = 64;  ///< limit of the motion, pixels

  /// Motion of a block during the exposure: samples are at the multiples of (dx, dy) between
  /// -length / 2 and length / 2.
  struct Path {
    float dx;  ///< +-1 along the longer axis
    float dy;
    float length;  ///< along the longer axis, at least 1
  };

  MotionDeblur(int width, int height);

  /// Sets the motion during the exposure of the first frame or, if `at_end`, of the second: the
  /// flow from the first to the second, times the share of the exposure in the interval. The flow,
  /// on the grid of the first frame, is assumed to continue.
  void set_motion(const ImageView<Flow>& flow, double share, bool at_end, ThreadPool& threads);

  /// Path of the block that contains pixel (x, y).
  const Path& path(int x, int y) const { return paths_.row(y)[x / block]; }

  /// Replaces a frame of this size by the estimate.
  template <class Pixel>
  void sharpen(Image<Pixel>& frame, int bits, ThreadPool& threads);

 private:
  Image<Path> paths_;
  std::vector<char> moves_;  ///< by row
  Image<float> frame_;       ///< grey levels, white is 255
  Image<float> light_;
  Image<float> ratio_;
};

}  // namespace eventcamera
