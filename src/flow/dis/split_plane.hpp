// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "src/flow/scratch.hpp"

namespace eventcamera {

/// Floats that start on a cache line and fill whole lines; initially 0.
class AlignedFloats {
 public:
  explicit AlignedFloats(std::ptrdiff_t count)
      : lines_(static_cast<std::size_t>(count / row_padding)) {}

  float* data() { return reinterpret_cast<float*>(lines_.data()); }
  const float* data() const { return reinterpret_cast<const float*>(lines_.data()); }

 private:
  struct alignas(row_padding * sizeof(float)) Line {
    float values[row_padding];
  };
  std::vector<Line> lines_;
};

/// Plane of floats that keeps the even and the odd columns of a row apart. The neighbours of every
/// other pixel of a row are then contiguous, as red-black relaxation needs them.
class SplitPlane {
 public:
  /// All values are 0.
  SplitPlane(int width, int height)
      : width_(width),
        height_(height),
        odd_(std::ptrdiff_t{(count(0) + 3 * row_padding) / row_padding} * row_padding),
        values_(2 * odd_ * height + row_padding) {}

  int width() const { return width_; }
  int height() const { return height_; }
  /// Number of columns of a parity.
  int count(int parity) const { return (width_ + 1 - parity) / 2; }
  /// Columns of a parity: column x at x / 2. One before the first and two vectors past the last
  /// exist.
  float* row(int parity, int y) { return values_.data() + start_of(parity, y); }
  const float* row(int parity, int y) const { return values_.data() + start_of(parity, y); }
  float& at(int x, int y) { return row(x & 1, y)[x / 2]; }
  float at(int x, int y) const { return row(x & 1, y)[x / 2]; }
  /// From row 0 to row y; the same for all planes of this width.
  std::ptrdiff_t offset(int y) const { return 2 * odd_ * y; }

  /// Replicates the first and the last pixel of row y beyond its ends.
  void replicate_ends(int y) {
    row(1, y)[-1] = row(0, y)[0];
    row(width_ & 1, y)[width_ / 2] = at(width_ - 1, y);
  }
  void clear_row(int y) { std::fill_n(row(0, y) - 1, 2 * odd_, 0.0F); }
  /// Copies a row of a plane of the same width to row y.
  void copy_row(int y, const SplitPlane& from, int from_y) {
    std::copy_n(from.row(0, from_y), odd_ + count(1), row(0, y));
  }

 private:
  std::ptrdiff_t start_of(int parity, int y) const { return row_padding + (2 * y + parity) * odd_; }

  int width_;
  int height_;
  std::ptrdiff_t odd_;  ///< from the even columns of a row to the odd ones
  AlignedFloats values_;
};

/// Several values per pixel, split like in SplitPlane. They are interleaved in blocks, and thus
/// read as one stream.
template <int values>
class SplitPlanes {
 public:
  static constexpr std::ptrdiff_t block = row_padding;

  SplitPlanes(int width, int height)
      : odd_(((width + 1) / 2 + 2 * block - 1) / block * block * values),
        values_(2 * odd_ * height) {}

  float* row(int parity, int y) { return values_.data() + (2 * y + parity) * odd_; }
  const float* row(int parity, int y) const { return values_.data() + (2 * y + parity) * odd_; }
  /// Offset of the first value of pixel k in a row; the others follow `block` floats apart.
  static std::ptrdiff_t offset_of(int k) { return k / block * block * values + k % block; }

 private:
  std::ptrdiff_t odd_;
  AlignedFloats values_;
};

}  // namespace eventcamera
