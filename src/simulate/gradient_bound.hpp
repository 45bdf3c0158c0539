// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// How much neighbouring pixels of a picture differ at most, cell by cell: 4x4 pixels for looking
/// near, 16x16 for looking far.
class GradientBound {
 public:
  /// `picture` must be the view of an Image: SIMD code reads behind its end.
  void measure(const ImageView<std::uint8_t>& picture, ThreadPool& threads);

  struct Bound {
    int x;  ///< of a pixel and the one to its right, grey levels
    int y;  ///< of a pixel and the one below it
  };

  /// The largest in a box, which may reach beyond the picture, or in a little more.
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
