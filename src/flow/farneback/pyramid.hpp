// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/core/image.hpp"

namespace eventcamera {

/// Positions of the pixels of a line on a line of another length that covers the same ground:
/// between two pixels of it, or on the first or the last.
class Resampling {
 public:
  Resampling() = default;
  Resampling(int from, int to);

  int size() const { return size_; }
  /// The earlier of the two pixels.
  const std::int32_t* first() const { return first_.data(); }
  /// Weight of the later one, [0, 1); 0 where there is none.
  const float* weight() const { return weight_.data(); }

 private:
  int size_ = 0;
  std::vector<std::int32_t> first_;
  std::vector<float> weight_;
};

/// Resamples a row. One number past its end is read, with weight 0.
void resample_row(const float* row, const Resampling& resampling, float* out);

/// Interpolates a row of pairs between two others (`weight` is that of the lower one), resamples it
/// and multiplies it by `factor`. `between` is scratch as long as one of them with its padding.
void resample_pairs(const float* upper, const float* lower, float weight, int width,
                    const Resampling& resampling, float factor, float* between, float* out);

/// A picture blurred by a Gaussian and shrunk to 1 / 2^level of its size, row by row. A blur of
/// about half a pixel of the shrunk picture prevents aliasing; level 0 is blurred slightly, against
/// noise.
class PyramidLevel {
 public:
  struct Scratch {
    std::vector<float> column_sums;
    std::vector<float> blurred;
  };

  /// Of pictures of this size.
  PyramidLevel(int width, int height, int level);

  int width() const { return columns_.size(); }
  int height() const { return rows_.size(); }
  /// Writes row y to `out`, which has row_padding elements past its end.
  void row(const ImageView<std::uint8_t>& picture, int y, Scratch& scratch, float* out) const;

 private:
  bool full_size_;
  std::vector<float> kernel_;
  Resampling columns_;
  Resampling rows_;
};

}  // namespace eventcamera
