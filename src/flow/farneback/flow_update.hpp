// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "src/flow/dense_flow.hpp"
#include "src/flow/farneback/polynomial_expansion.hpp"

namespace eventcamera {

/// Rows of a flow field, starting with row `first`, each padded by row_padding pixels.
struct FlowRows {
  Flow* data;
  std::ptrdiff_t stride;  ///< pixels from one row to the next
  int first;

  Flow* row(int y) const { return data + (y - first) * stride; }
};

/// One iteration of Farneback's method, which refines a flow.
///
/// The polynomials at both ends of a pixel's flow differ by a shift, which solves two linear
/// equations. These are summed over a window (least squares) and solved for the flow of its centre.
/// The result does not depend on how rows are divided between calls.
class FlowUpdate {
 public:
  static constexpr int reach = 7;      ///< pixels each way from the centre of a window
  static constexpr int strip = 128;    ///< columns that are processed together
  static constexpr int equations = 5;  ///< coefficients: symmetric 2x2 matrix and right-hand side
  static constexpr int border = 5;     ///< width of the border where polynomials weigh less

  /// Sums of the equations of a strip over fifteen rows.
  ///
  /// Rows are counted from the first window's first one, in blocks of fifteen. The sum over a
  /// window is that of the end of a block and that of the start of the next one.
  struct RowSums {
    /// Equations of the rows of a block; once it is complete, of each row and all after it. The
    /// last row is 0.
    alignas(64) float rows[2 * reach + 2][equations][strip];
    alignas(64) float start[equations][strip];  ///< sum of the first rows of the present block
  };
  struct Scratch {
    std::vector<RowSums> sums;
    std::vector<float> edges;  ///< of a strip, which the one to the right needs
  };

  FlowUpdate() = default;
  FlowUpdate(int width, int height);

  /// Fills rows [first, last) of `out`. Reads these rows of `flow` and `reach` more on each side,
  /// as far as they exist.
  void run(const PolynomialExpansion& from, const PolynomialExpansion& to, const FlowRows& flow,
           int first, int last, Scratch& scratch, const FlowRows& out) const;

 private:
  std::vector<float> column_weights_;
  std::vector<float> row_weights_;
};

}  // namespace eventcamera
