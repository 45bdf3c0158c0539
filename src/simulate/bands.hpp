// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>

namespace eventcamera {

/// A picture is worked on in bands of this many rows, however many threads share them, so that the
/// result does not hang on the threads.
inline constexpr int rows_per_band = 16;

inline int band_count(int height) {
  return (height + rows_per_band - 1) / rows_per_band;
}

/// The rows [first, last) of a band.
struct BandRows {
  BandRows(int band, int height)
      : first(band * rows_per_band), last(std::min(first + rows_per_band, height)) {}
  int first;
  int last;
};

}  // namespace eventcamera
