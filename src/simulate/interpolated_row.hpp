// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/flow/dense_flow.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera {

/// A row of the blended frame of step j = 1 ... steps - 1 between two frames. Of frames in 8 bits
/// it has 16, so that the dark has more shades than grey levels; of others their own depth. The
/// frames in 8 bits must be Planes: SIMD code reads behind their ends.
void interpolate_row(const Warp<std::uint8_t>& warp, const ImageView<Flow>& flow, int y, int j,
                     std::uint16_t* out);
void interpolate_row(const Warp<std::uint16_t>& warp, const ImageView<Flow>& flow, int y, int j,
                     std::uint16_t* out);

/// A row of a frame, as interpolate_row() would give it.
void widen_row(const std::uint8_t* luma, int width, std::uint16_t* out);
void widen_row(const std::uint16_t* luma, int width, std::uint16_t* out);

}  // namespace eventcamera
