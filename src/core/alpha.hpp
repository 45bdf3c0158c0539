// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "src/core/image.hpp"
#include "src/core/luma.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Alpha of a frame, samples as wide as those of its luma.
struct AlphaView {
  const void* data = nullptr;
  std::ptrdiff_t stride = 0;  ///< bytes from one row to the next
  int step = 1;               ///< samples from one pixel to the next, 1 or 4
};

/// Composites luma on black: (luma * alpha + black * (white - alpha)) / white, rounded. `out` has
/// the size of the frame, and may be what `luma` views.
void composite_on_black(const LumaView& luma, const AlphaView& alpha, ThreadPool& threads,
                        Image<std::uint8_t>& out);
void composite_on_black(const LumaView& luma, const AlphaView& alpha, ThreadPool& threads,
                        Image<std::uint16_t>& out);

}  // namespace eventcamera
