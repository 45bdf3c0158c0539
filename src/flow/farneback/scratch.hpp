// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <vector>

namespace eventcamera {

/// Elements past the end of a row that SIMD kernels may read and write. No vector is longer.
inline constexpr int row_padding = 16;

/// At least `count` elements, with what they held before. The vector only grows: once it has seen
/// the largest of several sizes in turn, it allocates no more.
template <class T>
T* scratch_of(std::vector<T>& vector, std::size_t count) {
  if (vector.size() < count) vector.resize(count);
  return vector.data();
}

}  // namespace eventcamera
