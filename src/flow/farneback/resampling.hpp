// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

namespace eventcamera {

/// Where the pixels of a line of one length lie on a line of another that covers the same ground:
/// between two pixels there, or on the first or the last.
class Resampling {
 public:
  /// Rows that SIMD code works on go on for this many pixels behind their ends.
  static constexpr int spare = 16;

  Resampling() = default;
  Resampling(int from, int to);

  int size() const { return size_; }
  /// The earlier of the two pixels.
  const std::int32_t* first() const { return first_.data(); }
  /// How much the later one counts, [0, 1); 0 where there is none.
  const float* weight() const { return weight_.data(); }

 private:
  int size_ = 0;
  std::vector<std::int32_t> first_;
  std::vector<float> weight_;
};

/// Resamples a row. Behind its end lies one more number, which does not count.
void resample_row(const float* row, const Resampling& resampling, float* out);

/// Resamples a row of pairs that lies between two others, by `weight` nearer to the lower one, and
/// multiplies it. It is worked out in `between`, which is as long as one of them with its spare.
void resample_pairs(const float* upper, const float* lower, float weight, int width,
                    const Resampling& resampling, float factor, float* between, float* out);

}  // namespace eventcamera
