// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <vector>

namespace eventcamera {

/// Room for so many elements, with whatever was there before. The vector only grows: one that
/// serves work of several sizes in turn allocates nothing once it has seen the largest.
template <class T>
T* room_in(std::vector<T>& vector, std::size_t count) {
  if (vector.size() < count) vector.resize(count);
  return vector.data();
}

}  // namespace eventcamera
