// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Upper bounds of the differences of neighbouring pixels, by cells: of 4x4 pixels for small boxes,
/// of 16x16 for large ones.
class GradientBound {
 public:
  /// `picture` must be the view of an Image: SIMD code reads past its rows.
  void measure(const ImageView<std::uint8_t>& picture, ThreadPool& threads);

  struct Bound {
    int x;  ///< of a pixel and the one to its right, grey levels
    int y;  ///< of a pixel and the one below it
  };

  /// The bound in a box, or in a little more. The box may reach beyond the picture.
  Bound within(const Box& box) const;

 private:
  /// Square cells of one size.
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
