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
  static constexpr int reach = 7;   ///< pixels each way from the centre of a window
  static constexpr int border = 5;  ///< width of the border where polynomials weigh less

  struct Scratch {
    std::vector<float> tensors;  ///< equations of the last rows
    std::vector<float> threes;   ///< their sums over three rows
    std::vector<float> window_rows;
    std::vector<float> row_threes;
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
