// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <list>

#include "src/flow/farneback/polynomial_expansion.hpp"
#include "src/gl/objects.hpp"

namespace eventcamera::gl {

/// Dense optical flow, like eventcamera::FarnebackFlow; the flow between equal pictures is 0.
class FarnebackFlow {
 public:
  FarnebackFlow(const Context& gl, const LumaFormat& format);

  /// Makes `picture` the later picture, and the previous one the earlier picture.
  void push(const GreyFrame& picture);

  /// Computes the flow from the earlier picture to the later one: two floats per pixel, x and y, in
  /// raster order. Needs two push() first. Valid until the next call.
  const Buffer& find() const;

 private:
  struct Level {
    Level(const Context& gl, const LumaFormat& format, int level);

    PyramidLevel pyramid;
    int width;
    int height;
    Buffer blur;            ///< weights
    Buffer polynomials[2];  ///< of the last two pictures
    Buffer flow;            ///< of the rows that FlowUpdate finds
  };

  LumaFormat format_;
  Kernel shrink_;
  Kernel expand_;
  Kernel upsample_;
  Kernel equations_;
  Kernel solve_;
  std::list<Level> levels_;  ///< finest first
  Buffer fit_;               ///< FitKernels
  Buffer no_flow_;           ///< of the coarsest level
  Buffer shrunk_;            ///< picture of a level
  Buffer equations_of_pixels_;
  Buffer flow_;   ///< of all rows
  int last_ = 0;  ///< index of the later polynomials
};

}  // namespace eventcamera::gl
