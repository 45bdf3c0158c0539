// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Displacement of a pixel from the earlier frame to the later one, in pixels.
struct Flow {
  float x;
  float y;
};

/// Dense-flow algorithms.
enum class FlowMethod {
  dis_lq,      ///< DIS, low quality and fast: patches of 4 at strides of 3, 8 iterations, 3 scales
  dis_hq,      ///< DIS, high quality: patches of 8 at strides of 4, 32 iterations
  farneback,   ///< Farneback: up to 4 levels, window 15, 3 iterations, polynomials of 5 pixels
  opencv_dis,  ///< OpenCV's DIS with the parameters of dis_hq
};

/// Dense optical flow between 8-bit images of any size. Each image serves twice, first as the
/// later, then as the earlier one; what depends on it alone is computed only once.
class DenseFlow {
 public:
  virtual ~DenseFlow() = default;

  /// Makes `picture` the later image, and the previous one the earlier image. `picture` need not
  /// outlive the call.
  virtual void push(const ImageView<std::uint8_t>& picture, ThreadPool& threads) = 0;

  /// Returns the flow from the earlier image to the later one. Needs two push() of the same size
  /// first. Valid until the next call; the same for any number of threads.
  virtual ImageView<Flow> flow(ThreadPool& threads) = 0;

  /// Returns the flow between two images, independent of earlier calls.
  ImageView<Flow> find(const ImageView<std::uint8_t>& from, const ImageView<std::uint8_t>& to,
                       ThreadPool& threads) {
    push(from, threads);
    push(to, threads);
    return flow(threads);
  }
};

std::unique_ptr<DenseFlow> make_dense_flow(FlowMethod method);

}  // namespace eventcamera
