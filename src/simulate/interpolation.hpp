// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/event_buckets.hpp"
#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/simulate/simulator.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera {

/// Two frames, how to interpolate between them, and the thresholds of the pixels.
template <class Pixel>
struct InterpolatedInterval {
  Warp<Pixel> warp;  ///< 8-bit frames must be views of Images: SIMD code reads past their rows
  ImageView<Flow> flow;
  Interpolation interpolation;
  StepTimes steps;
  Thresholds thresholds;
};

/// Upper bounds of the differences between neighbouring pixels, in cells of 4x4 pixels for small
/// boxes, 16x16 for large ones.
class GradientBound {
 public:
  /// `image` must be the view of an Image: SIMD code reads past its rows.
  void measure(const ImageView<std::uint8_t>& image, ThreadPool& threads);

  struct Bound {
    int x;  ///< between a pixel and its right neighbour, grey levels
    int y;  ///< between a pixel and the one below it, grey levels
  };

  /// Bound for `box`, rounded out to whole cells. `box` may extend beyond the image.
  Bound within(const Box& box) const;

 private:
  /// Maxima per square cell of one size.
  struct Cells {
    int side = 0;
    Image<std::uint8_t> x;
    Image<std::uint8_t> y;

    void shape(int cell_side, int columns, int rows);
    Bound within(const Box& box) const;
  };

  Cells near_;
  Cells far_;
};

/// Generates the events of interpolated frames, pixel by pixel through all steps, without storing
/// the frames.
///
/// Most pixels cannot fire before the last step, as a conservative bound proves: a step of (dx, dy)
/// pixels changes a bilinear sample by at most |dx| gx + |dy| gy, where gx and gy are the largest
/// differences of neighbours within reach. Tiles whose bound does not exceed the thresholds skip to
/// the last step.
class InterpolationKernel {
 public:
  void fire(const InterpolatedInterval<std::uint8_t>& interval, ThreadPool& threads,
            StepBuckets& events);
  void fire(const InterpolatedInterval<std::uint16_t>& interval, ThreadPool& threads,
            StepBuckets& events);

 private:
  GradientBound gradient_bound_;
  Image<std::uint16_t> last_pairs_;  ///< the last frame, each pixel paired with the one below it
};

}  // namespace eventcamera
