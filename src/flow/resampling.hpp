// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/flow/dense_flow.hpp"

namespace eventcamera {

/// Linear resampling of a row to another length: each output pixel lies between two input pixels,
/// or on the first or last one.
class Resampling {
 public:
  Resampling() = default;
  Resampling(int from, int to);

  int size() const { return size_; }
  /// First of the two pixels.
  const std::int32_t* first() const { return first_.data(); }
  /// Weight of the second pixel, [0, 1); 0 if there is none.
  const float* weight() const { return weight_.data(); }

 private:
  int size_ = 0;
  std::vector<std::int32_t> first_;
  std::vector<float> weight_;
};

/// Resamples a row. Reads one element past its end, with weight 0; writes up to a vector past the
/// end of `out`.
void resample_row(const float* row, const Resampling& resampling, float* out);

/// Resamples a row of flow and multiplies it by `factor`. Reads and writes up to a vector past the
/// ends.
void resample_row(const Flow* row, const Resampling& resampling, float factor, Flow* out);

/// The same, only for columns [first, last).
void resample_columns(const Flow* row, const Resampling& resampling, int first, int last,
                      float factor, Flow* out);

/// Interpolates between two rows of a flow; `weight` applies to the lower row. Reads and writes up
/// to a vector past the ends.
void blend_rows(const Flow* upper, const Flow* lower, float weight, int width, Flow* out);

}  // namespace eventcamera
