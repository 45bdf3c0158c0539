// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

// Guide to this folder: which file computes which equation. I is the earlier image, J the later
// one.
//
// dis/: Kroeger et al., Fast optical flow using dense inverse search, ECCV 2016
//   pyramid.cpp                   scales and image gradients
//   patches.cpp                   flow u of a patch: minimises sum((J(x + u) - I(x))^2), with the
//                                 mean difference removed; spatial propagation; mean flow of the
//                                 patches that cover a pixel, weighted by match
//   variational_refinement.cpp    brightness constancy, gradient constancy and smoothness: Brox et
//                                 al., High accuracy optical flow estimation based on a theory for
//                                 warping, ECCV 2004
//   dis.cpp                       scales, coarse to fine
// farneback/: Farneback, Two-frame motion estimation based on polynomial expansion, SCIA 2003
//   polynomial_expansion.cpp      scales; I(x) ~ x^T A x + b^T x + c around each pixel
//   flow_update.cpp               A d = -(b_J - b_I) / 2 by least squares over a window
//   farneback.cpp                 scales and iterations
// lucas_kanade/: Lucas and Kanade, An iterative image registration technique, IJCAI 1981;
// Bouguet, Pyramidal implementation of the Lucas Kanade feature tracker, Intel 2000
//   pyramid.cpp                   scales and image gradients g
//   search.cpp                    sum(g g^T) d = sum(g (I - J)) over a window, iterated; only where
//                                 there is enough texture, sum(g g^T)
//   point_tracker.cpp             scales and points

namespace eventcamera {

/// Displacement of a pixel from the earlier frame to the later one, in pixels.
struct Flow {
  float x;
  float y;
};

/// Dense-flow algorithms, by the values of the property `flow`.
enum class FlowMethod {
  dis_lq,      ///< DIS, low quality and fast: patches of 4 at strides of 3, 8 iterations, 3 scales
  dis_hq,      ///< DIS, high quality: patches of 8 at strides of 4, 32 iterations
  farneback,   ///< Farneback: up to 4 levels, 2 to 5 iterations, polynomials of 5 pixels
  opencv_dis,  ///< OpenCV's DIS with the parameters of dis_hq; only in builds with OpenCV
  dis_mq,      ///< dis_lq with 4 scales or more, at least 1/8 of the size, and propagation
};

/// Dense optical flow between successive 8-bit images of any size. Each image is used twice, first
/// as the later, then as the earlier one; what depends on one image alone is computed once.
class DenseFlow {
 public:
  virtual ~DenseFlow() = default;

  /// Makes `image` the later image, and the previous one the earlier image. `image` need not
  /// outlive the call.
  virtual void push(const ImageView<std::uint8_t>& image, ThreadPool& threads) = 0;

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
