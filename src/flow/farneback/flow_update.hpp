// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "src/flow/dense_flow.hpp"
#include "src/flow/farneback/polynomial_expansion.hpp"

namespace eventcamera {

/// The rows of a flow from `first` on, with row_padding pixels past the end of each.
struct FlowRows {
  Flow* data;
  std::ptrdiff_t stride;  ///< pixels from one row to the next
  int first;

  Flow* row(int y) const { return data + (y - first) * stride; }
};

/// One iteration of Farneback's method: from a flow to a better one.
///
/// The polynomials at both ends of a pixel's flow differ by a shift, which solves two linear
/// equations. They are summed over a window, as least squares, and solved for the flow of its
/// centre. The result does not depend on how the rows are divided.
class FlowUpdate {
 public:
  static constexpr int reach = 7;   ///< pixels each way from the centre of a window
  static constexpr int border = 5;  ///< width of the border where polynomials weigh less

  struct Scratch {
    std::vector<float> tensors;  ///< the equations of the last rows
    std::vector<float> threes;   ///< and their sums over three rows
    std::vector<float> window_rows;
    std::vector<float> row_threes;
  };

  FlowUpdate() = default;
  FlowUpdate(int width, int height);

  /// Fills rows [first, last) of `out` from `reach` more rows of `flow` on both sides, as far as
  /// there are any.
  void run(const PolynomialExpansion& from, const PolynomialExpansion& to, const FlowRows& flow,
           int first, int last, Scratch& scratch, const FlowRows& out) const;

 private:
  std::vector<float> column_weights_;
  std::vector<float> row_weights_;
};

}  // namespace eventcamera
