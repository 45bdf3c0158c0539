// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/flow/dense_flow.hpp"

namespace eventcamera {

/// Maps the pixels of a row to positions on a row of another length and the same extent: between
/// two of its pixels, or on its first or last one.
class Resampling {
 public:
  Resampling() = default;
  Resampling(int from, int to);

  int size() const { return size_; }
  /// First of the two pixels.
  const std::int32_t* first() const { return first_.data(); }
  /// Weight of the second one, [0, 1); 0 if there is none.
  const float* weight() const { return weight_.data(); }

 private:
  int size_ = 0;
  std::vector<std::int32_t> first_;
  std::vector<float> weight_;
};

/// Resamples a row. Reads one element past its end, with weight 0; writes up to a vector past the
/// end of `out`.
void resample_row(const float* row, const Resampling& resampling, float* out);

/// Resamples a row of a flow, likewise, and multiplies it by `factor`. Reads up to a vector past
/// its end.
void resample_row(const Flow* row, const Resampling& resampling, float factor, Flow* out);

/// The same for columns [first, last) alone.
void resample_columns(const Flow* row, const Resampling& resampling, int first, int last,
                      float factor, Flow* out);

/// Interpolates between two rows of a flow; `weight` applies to the lower row. Reads and writes up
/// to a vector past the ends.
void blend_rows(const Flow* upper, const Flow* lower, float weight, int width, Flow* out);

}  // namespace eventcamera
