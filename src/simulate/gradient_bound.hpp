// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Upper bounds of the differences between neighbouring pixels, per cell: 4x4 pixels for small
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

}  // namespace eventcamera
