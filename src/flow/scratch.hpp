// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <vector>

namespace eventcamera {

/// Elements past the end of a row that SIMD kernels may read and write; also the maximum vector
/// length.
inline constexpr int row_padding = 16;

/// Returns at least `count` elements, which keep their values. The vector never shrinks, so sizes
/// that alternate cause no allocations once the largest was seen.
template <class T>
T* scratch_of(std::vector<T>& vector, std::size_t count) {
  if (vector.size() < count) vector.resize(count);
  return vector.data();
}

}  // namespace eventcamera
