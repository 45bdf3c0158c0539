// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/core/image.hpp"

namespace eventcamera {

/// Maps the pixels of a row to positions on a row of another length and the same extent: between
/// two of its pixels, or on its first or last one.
class Resampling {
 public:
  Resampling() = default;
  Resampling(int from, int to);

  int size() const { return size_; }
  /// First of the two pixels.
  const std::int32_t* first() const { return first_.data(); }
  /// Weight of the second one, [0, 1); 0 if there is none.
  const float* weight() const { return weight_.data(); }

 private:
  int size_ = 0;
  std::vector<std::int32_t> first_;
  std::vector<float> weight_;
};

/// Resamples a row. Reads one element past its end, with weight 0.
void resample_row(const float* row, const Resampling& resampling, float* out);

/// Interpolates between two rows of pairs (`weight` is that of the lower one), resamples the result
/// and multiplies it by `factor`. `between` is scratch for one such row with its padding.
void resample_pairs(const float* upper, const float* lower, float weight, int width,
                    const Resampling& resampling, float factor, float* between, float* out);

/// Blurs an image with a Gaussian and shrinks it to 1 / 2^level of its size, row by row. A blur of
/// about half a pixel of the shrunk image prevents aliasing; level 0 is blurred slightly, against
/// noise.
class PyramidLevel {
 public:
  struct Scratch {
    std::vector<float> column_sums;
    std::vector<float> blurred;
  };

  /// For images of this size.
  PyramidLevel(int width, int height, int level);

  int width() const { return columns_.size(); }
  int height() const { return rows_.size(); }
  /// Weights of the blur along each axis, an odd number.
  const std::vector<float>& kernel() const { return kernel_; }
  /// Writes row y to `out`, which must have row_padding elements past its end.
  void row(const ImageView<std::uint8_t>& picture, int y, Scratch& scratch, float* out) const;

 private:
  bool full_size_;
  std::vector<float> kernel_;
  Resampling columns_;
  Resampling rows_;
};

}  // namespace eventcamera
