// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>

#include "src/flow/lucas_kanade/scharr_gradients.hpp"
#include "src/flow/lucas_kanade/search.hpp"

namespace eventcamera {

/// Pixels of a tile without sub-pixel offset: bit x of row y.
using TilePixels = std::array<std::uint16_t, Tile::side>;

/// Pixels whose windows may have enough texture for search_tile(); all others certainly have too
/// little. Needs the gradients in all windows.
TilePixels textured_pixels(const ScharrGradients& gradients, const Tile& tile);

}  // namespace eventcamera
