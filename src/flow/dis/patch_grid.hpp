// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace eventcamera {

/// Overlapping square patches of an image, in rows and columns. The last row and column end at or
/// before the border.
struct PatchGrid {
  PatchGrid(int width, int height, int side_, int stride_)
      : side(side_),
        stride(stride_),
        columns(1 + (width - side_) / stride_),
        rows(1 + (height - side_) / stride_) {}

  int side;  ///< 4 or 8 pixels
  int stride;
  int columns;
  int rows;
};

}  // namespace eventcamera
