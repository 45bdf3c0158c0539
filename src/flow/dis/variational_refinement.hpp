// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/flow/scratch.hpp"

namespace eventcamera {

/// Plane of floats that stores the even columns of a row before its odd columns, so that red-black
/// relaxation finds the neighbours of every other pixel in contiguous memory.
class SplitPlane {
 public:
  SplitPlane(int width, int height)
      : width_(width),
        height_(height),
        odd_(std::ptrdiff_t{(count(0) + 3 * row_padding) / row_padding} * row_padding),
        values_(static_cast<int>(2 * odd_ * height) + row_padding, 1) {}

  int width() const { return width_; }
  int height() const { return height_; }
  int count(int parity) const { return (width_ + 1 - parity) / 2; }
  /// Columns of a parity: column x is at x / 2. One element before the first and two vectors past
  /// the last exist.
  float* row(int parity, int y) { return values_.row(0) + start_of(parity, y); }
  const float* row(int parity, int y) const { return values_.row(0) + start_of(parity, y); }
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
  Image<float> values_;
};

/// Several values per pixel, with columns split as in SplitPlane. The values are interleaved in
/// blocks, so that they are read as one stream.
template <int values>
class SplitPlanes {
 public:
  static constexpr std::ptrdiff_t block = row_padding;

  SplitPlanes(int width, int height)
      : odd_(((width + 1) / 2 + 2 * block - 1) / block * block * values),
        values_(static_cast<int>(2 * odd_ * height), 1) {}

  float* row(int parity, int y) { return values_.row(0) + (2 * y + parity) * odd_; }
  const float* row(int parity, int y) const { return values_.row(0) + (2 * y + parity) * odd_; }
  /// Offset of the first value of pixel k in a row; the others follow `block` floats apart.
  static std::ptrdiff_t offset_of(int k) { return k / block * block * values + k % block; }

 private:
  std::ptrdiff_t odd_;
  Image<float> values_;
};

/// Refines a flow by minimising an energy (Brox et al., ECCV 2004): brightness and gradients stay
/// constant along the flow, and the flow is smooth, all with robust penalties. The images are
/// linearised once, at the given flow. Five times, the penalties are evaluated at the refined flow,
/// and five rounds of red-black successive over-relaxation solve the resulting linear equations.
///
/// Threads compute bands of rows and, for each evaluation, the rows around them that affect them.
class VariationalRefinement {
 public:
  struct Field {
    Field(int width, int height) : x(width, height), y(width, height) {}
    SplitPlane x;
    SplitPlane y;
  };

  /// Derivatives of the images: along x and y, over two pixels, of their mean, and from the earlier
  /// to the later one.
  struct Derivatives {
    Derivatives(int width, int height) : x(width, height), y(width, height), t(width, height) {}
    SplitPlane x;
    SplitPlane y;
    SplitPlane t;
  };

  /// Coefficients of a pixel's equations: relaxation adds inverse_x (constant_x - cross y +
  /// smoothness terms) to a multiple of its flow in x, and likewise in y.
  enum { cross, inverse_x, inverse_y, constant_x, constant_y, max_coefficients };

  /// Ring of the rows that a thread works on: row y is at y % rows.
  struct Scratch {
    static constexpr int rows = 16;

    explicit Scratch(int width)
        : flow(width, rows),
          weight(width, rows),
          right(width, 2),
          equations(width, rows),
          mean(width, rows),
          change(width, rows) {}

    Field flow;
    SplitPlane weight;  ///< smoothness weight between a pixel and its right and lower neighbours
    SplitPlane right;   ///< the same for the last two rows, but 0 for their last pixels
    SplitPlanes<max_coefficients> equations;
    SplitPlane mean;    ///< of both images
    SplitPlane change;  ///< from the earlier image to the later one
  };

  VariationalRefinement(int width, int height);

  int width() const { return flows_[0].x.width(); }
  int height() const { return flows_[0].x.height(); }
  /// The flow to refine.
  Field& start() { return start_; }
  void run(const Image<std::uint8_t>& from, const Image<std::uint8_t>& to, ThreadPool& threads);
  /// The refined flow at a pixel.
  Flow at(int x, int y) const { return {flows_[0].x.at(x, y), flows_[0].y.at(x, y)}; }
  /// The refined flow of a row. Up to 32 elements past the end of `out` are written.
  void row(int y, Flow* out) const;

 private:
  Field start_;
  std::array<Field, 2> flows_;  ///< the current one, the next one
  Derivatives derivatives_;
  std::vector<Scratch> scratch_;
};

}  // namespace eventcamera
