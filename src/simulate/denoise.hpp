// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Removes the frame's noise, which an event camera would not see, but keeps edges: adds to each
/// pixel the weighted mean of the differences to its 3x3 neighbourhood (weights 1 2 1 by 1 2 1, sum
/// 16), each difference clamped to `limit` luma values. The border is replicated. `out` must have
/// the size of `frame`. The reference implementation is `reference::denoised()`.
void denoise(const ImageView<std::uint8_t>& frame, int limit, ThreadPool& threads,
             Image<std::uint8_t>& out);
void denoise(const ImageView<std::uint16_t>& frame, int limit, ThreadPool& threads,
             Image<std::uint16_t>& out);

}  // namespace eventcamera
