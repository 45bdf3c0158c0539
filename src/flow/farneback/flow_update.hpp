// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <vector>

#include "src/flow/dense_flow.hpp"
#include "src/flow/farneback/polynomial_expansion.hpp"

namespace eventcamera {

/// The rows of a flow from `first` on, with Resampling::spare pixels behind each.
struct FlowRows {
  Flow* data;
  std::ptrdiff_t stride;  ///< pixels from one row to the next
  int first;

  Flow* row(int y) const { return data + (y - first) * stride; }
};

/// One iteration of Farneback's method: from a flow to a better one.
///
/// If a pixel of the earlier picture went along its flow, the polynomials there and where it came
/// to would differ by a shift, and that shift solves two linear equations. They are summed up in
/// least squares over a window, and solved for the flow of its middle. Every number comes about in
/// the same way wherever the work on rows begins and ends.
class FlowUpdate {
 public:
  static constexpr int reach = 7;   ///< pixels each way from the middle of a window
  static constexpr int border = 5;  ///< pixels from the border in which polynomials count less

  /// What the work on some rows needs.
  struct Scratch {
    std::vector<float> tensors;  ///< the equations of the last rows
    std::vector<float> threes;   ///< and their sums over three rows
    std::vector<float> window_rows;
    std::vector<float> row_threes;
  };

  FlowUpdate() = default;
  FlowUpdate(int width, int height);

  /// Fills the rows [first, last) of `out`. That takes `reach` more rows of `flow` on both sides,
  /// as far as there are any.
  void run(const PolynomialExpansion& from, const PolynomialExpansion& to, const FlowRows& flow,
           int first, int last, Scratch& scratch, const FlowRows& out) const;

 private:
  std::vector<float> column_weights_;
  std::vector<float> row_weights_;
};

}  // namespace eventcamera
