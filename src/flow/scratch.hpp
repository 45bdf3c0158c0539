// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <vector>

namespace eventcamera {

/// Elements past the end of a row that SIMD kernels may read and write; also the maximum vector
/// length.
inline constexpr int row_padding = 16;

/// Grows a vector to at least `count` elements, and returns its data. It never shrinks, so that
/// alternating sizes do not allocate.
template <class T>
T* scratch_of(std::vector<T>& vector, std::size_t count) {
  if (vector.size() < count) vector.resize(count);
  return vector.data();
}

}  // namespace eventcamera
