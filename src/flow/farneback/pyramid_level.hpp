// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/core/image.hpp"
#include "src/flow/farneback/resampling.hpp"

namespace eventcamera {

/// A picture blurred by a Gaussian and shrunk to 1 / 2^level of its size, row by row. A blur of
/// about half a pixel of the shrunk picture keeps what it cannot show from showing as something
/// else; the full size is blurred a little, too, against noise.
class PyramidLevel {
 public:
  /// What the work on a row needs.
  struct Scratch {
    std::vector<float> column_sums;
    std::vector<float> blurred;
  };

  /// Of pictures of this size.
  PyramidLevel(int width, int height, int level);

  int width() const { return columns_.size(); }
  int height() const { return rows_.size(); }
  /// Row y goes to `out`, which has Resampling::spare places more than there are pixels.
  void row(const ImageView<std::uint8_t>& picture, int y, Scratch& scratch, float* out) const;

 private:
  bool full_size_;
  std::vector<float> kernel_;
  Resampling columns_;
  Resampling rows_;
};

}  // namespace eventcamera
