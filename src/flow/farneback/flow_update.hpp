// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "src/flow/dense_flow.hpp"
#include "src/flow/farneback/polynomial_expansion.hpp"

namespace eventcamera {

/// Ring of the last `count` rows of flow. Each row is padded by row_padding pixels.
struct FlowRows {
  Flow* data;
  std::ptrdiff_t stride;  ///< pixels from one row to the next
  int count;

  Flow* row(int y) const { return data + y % count * stride; }
};

/// One iteration of Farneback's method, which refines a flow.
///
/// The polynomials at both ends of a pixel's flow differ by a shift, which solves two linear
/// equations. These are summed over a window (least squares) and solved for the flow of its centre.
/// Polynomials vary slowly from row to row, so only every other row has equations, and gets flow
/// ("found rows"). The result does not depend on how columns are divided between calls.
class FlowUpdate {
 public:
  static constexpr int row_step = 2;   ///< image rows from one found row to the next
  static constexpr int row_reach = 3;  ///< found rows each way from the centre of a window
  static constexpr int window_rows = 2 * row_reach + 1;  ///< also rows of a block
  static constexpr int reach = 7;  ///< columns each way from the centre of a window
  static constexpr int window_columns = 2 * reach + 1;
  static constexpr int strip = 128;    ///< columns that are processed together
  static constexpr int equations = 5;  ///< coefficients: symmetric 2x2 matrix and right-hand side
  static constexpr int border = 5;     ///< width of the border where polynomials weigh less

  /// Added to the determinant of the mean equations. A tenth of OpenCV's, which shortens the flow
  /// of faint textures.
  static constexpr double regularization = 1e-4;

  /// Columns of flow needed on each side of the filled columns: `reach`, aligned. Further columns
  /// to the left, up to a multiple of 16, are read but have no effect.
  static constexpr int margin = 8;

  /// Sums of the equations of a strip over the rows of a window.
  ///
  /// Found rows are divided into blocks, starting at the first row of the first window. The sum
  /// over a window is the sum over the end of a block plus the sum over the start of the next.
  struct RowSums {
    /// Equations of the rows of a block; once it is complete, sums over each row and all later
    /// ones. The last row is 0.
    alignas(64) float rows[window_rows + 1][equations][strip];
    alignas(64) float start[equations][strip];  ///< sum of the first rows of the current block
  };
  struct Scratch {
    std::vector<RowSums> sums;
    std::vector<float> edges;  ///< last sums of a strip, needed by the strip to the right
  };

  FlowUpdate() = default;
  FlowUpdate(int width, int height);

  /// Number of found rows of an image.
  static constexpr int rows(int height) { return (height + row_step - 1) / row_step; }

  static constexpr int blocks(int height) {
    return (rows(height) + 2 * row_reach + window_rows - 1) / window_rows;
  }

  /// Fills columns [first, last), multiples of 8 or the border, of the `window_rows` found rows
  /// that end with the first row of a block. Needs `flow` in `margin` more columns on each side,
  /// and in the rows from `row_reach` before to `row_reach` after that first row. Must be called
  /// for all blocks in turn; does nothing for others.
  void run(const PolynomialExpansion& from, const PolynomialExpansion& to, const FlowRows& flow,
           int first, int last, int block, Scratch& scratch, const FlowRows& out) const;

 private:
  std::vector<float> column_weights_;
  std::vector<float> row_weights_;
};

}  // namespace eventcamera
