// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>

#include "src/core/image.hpp"

namespace eventcamera::reference {

/// out(x, y) = round(I(x, y) + sum over i, j in {-1, 0, 1} of
///   w(i) w(j) clamp(I(x + i, y + j) - I(x, y), -limit, limit)), w = 1/4, 1/2, 1/4;
/// halves are rounded up, and beyond the border lies what lies on it.
template <class Pixel>
Image<Pixel> denoised(const ImageView<Pixel>& frame, int limit) {
  Image<Pixel> out(frame.width, frame.height);
  const auto weight = [](int i) { return i == 0 ? 0.5 : 0.25; };
  for (int y = 0; y < frame.height; ++y) {
    for (int x = 0; x < frame.width; ++x) {
      const int centre = frame.row(y)[x];
      double value = centre;
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) {
          const int neighbour = frame.row(
              std::clamp(y + j, 0, frame.height - 1))[std::clamp(x + i, 0, frame.width - 1)];
          value += weight(i) * weight(j) * std::clamp(neighbour - centre, -limit, limit);
        }
      out.at(x, y) = static_cast<Pixel>(std::floor(value + 0.5));
    }
  }
  return out;
}

}  // namespace eventcamera::reference
