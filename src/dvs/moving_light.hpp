// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "src/dvs/run.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera {

/// Writes the luma of a run of pixels that move along the flow: a row for each blended frame j = 1
/// ... steps - 1, at out + (j - 1) * stride. 8-bit frames (which must be views of Images) are
/// widened to 16 bits, which keeps more shades in dark areas; deeper frames keep their depth. Rows
/// of `out` must have 8 elements past their end.
void move_light(const Warp<std::uint8_t>& warp, const ImageView<Flow>& flow, const Run& run,
                std::uint16_t* out, std::ptrdiff_t stride);
void move_light(const Warp<std::uint16_t>& warp, const ImageView<Flow>& flow, const Run& run,
                std::uint16_t* out, std::ptrdiff_t stride);

/// Converts pixels of a frame to the depth of move_light().
void widen(const std::uint8_t* luma, int count, std::uint16_t* out);
void widen(const std::uint16_t* luma, int count, std::uint16_t* out);

}  // namespace eventcamera
