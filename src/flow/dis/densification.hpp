// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "src/core/image.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/flow/dis/patch_grid.hpp"
#include "src/flow/dis/split_plane.hpp"

namespace eventcamera {

/// Computes rows [first, last) of the dense flow: the mean over the patches that cover a pixel,
/// weighted by how well they match it. The last patches of a row or column extend to the border.
/// `sums` is scratch.
void spread_patches(const PatchGrid& grid, const Image<std::uint8_t>& from,
                    const Image<std::uint8_t>& to, const Image<Flow>& flows, int first, int last,
                    std::vector<float>& sums, SplitPlane& x, SplitPlane& y);

}  // namespace eventcamera
