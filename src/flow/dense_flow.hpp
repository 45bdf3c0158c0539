// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/picture/plane.hpp"

namespace eventcamera {

/// Pixels from a place in the earlier frame to the same thing in the later one.
struct Flow {
  float x;
  float y;
};

/// How dense flow is found.
enum class FlowMethod {
  dis_lq,     ///< DIS, low quality and fast: patches of 4, overlap 0.05, 8 iterations, 3 scales
  dis_hq,     ///< DIS, high quality: patches of 8, overlap 0.4, 32 iterations
  farneback,  ///< Farneback: 3 levels, window 15, 3 iterations, polynomials of 5 pixels
};

/// Dense optical flow between two 8-bit pictures of one size, any size.
class DenseFlow {
 public:
  virtual ~DenseFlow() = default;
  /// The result is good until the next call, and the same for any number of threads.
  virtual PlaneView<Flow> find(const PlaneView<std::uint8_t>& from,
                               const PlaneView<std::uint8_t>& to, int threads) = 0;
};

std::unique_ptr<DenseFlow> make_dense_flow(FlowMethod method, int width, int height);

}  // namespace eventcamera
