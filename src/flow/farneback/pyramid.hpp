// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/core/image.hpp"
#include "src/flow/resampling.hpp"

namespace eventcamera {

/// Blurs an image with a Gaussian and shrinks it to 1 / 2^level of its size, row by row. The blur,
/// about half a pixel of the shrunk image, prevents aliasing; on level 0 it reduces noise.
class PyramidLevel {
 public:
  struct Scratch {
    std::vector<float> column_sums;
    std::vector<float> blurred;
  };

  PyramidLevel(int width, int height, int level);

  int width() const { return columns_.size(); }
  int height() const { return rows_.size(); }
  /// Weights of the blur along each axis, an odd number.
  const std::vector<float>& kernel() const { return kernel_; }
  /// Writes row y to `out`, which must have row_padding elements past its end.
  void row(const ImageView<std::uint8_t>& image, int y, Scratch& scratch, float* out) const;

 private:
  bool full_size_;
  std::vector<float> kernel_;
  Resampling columns_;
  Resampling rows_;
};

}  // namespace eventcamera
