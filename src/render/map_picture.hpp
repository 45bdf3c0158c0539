// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/image.hpp"
#include "src/render/rgb_picture.hpp"

namespace eventcamera {

/// Draws the event count per pixel, from black (none) to light yellow (99.5 % quantile of the
/// pixels with events), and below it a bar of these colours with that count. Throws std::bad_alloc.
RgbPicture draw_map(const Image<std::uint32_t>& map);

/// Draws the reference, the candidate and their difference side by side, on the same scale, with
/// bars: blue if the candidate has more events, red if it has fewer. Throws std::bad_alloc.
RgbPicture draw_maps(const Image<std::uint32_t>& reference, const Image<std::uint32_t>& candidate);

}  // namespace eventcamera
