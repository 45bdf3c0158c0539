// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

namespace plain {

using namespace eventcamera;

/// reference::denoised() in whole numbers, row by row on all threads.
inline void denoise(const ImageView<std::uint8_t>& frame, int limit, ThreadPool& threads,
                    Image<std::uint8_t>& out) {
  constexpr int weights[] = {1, 2, 1};
  threads.for_each(frame.height, [&](int y, int) {
    for (int x = 0; x < frame.width; ++x) {
      const int centre = frame.row(y)[x];
      int sum = 8;
      for (int j = -1; j <= 1; ++j) {
        const auto* row = frame.row(std::clamp(y + j, 0, frame.height - 1));
        for (int i = -1; i <= 1; ++i)
          sum += weights[i + 1] * weights[j + 1] *
                 std::clamp(row[std::clamp(x + i, 0, frame.width - 1)] - centre, -limit, limit);
      }
      out.at(x, y) = static_cast<std::uint8_t>(centre + (sum >> 4));
    }
  });
}

}  // namespace plain
