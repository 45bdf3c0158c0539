// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/core/image.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/flow/dis/patch_grid.hpp"
#include "src/flow/dis/pyramid.hpp"

namespace eventcamera {

/// Inverse search (Kroeger et al., ECCV 2016): finds the patches of a row in the other image by
/// gradient descent from their flows, and updates these. Compares deviations from the mean, so
/// brightness may change. A patch that would end farther from its start than its side keeps its
/// flow.
void search_row(const PatchGrid& grid, const Image<std::uint8_t>& from, const Gradients& gradients,
                const Image<std::uint8_t>& to, int row, int iterations, Flow* flows);

/// A neighbour's flow is better if its sum of squared differences is below this share of the
/// patch's own sum, by this margin; otherwise rounding would decide in plain areas.
constexpr float better_share = 0.9F;
constexpr float better_by = 1;

/// Spatial propagation: searches the patches of a row again from the best flow of their eight
/// neighbours, if it is better than their own.
void propagate_row(const PatchGrid& grid, const Image<std::uint8_t>& from,
                   const Gradients& gradients, const Image<std::uint8_t>& to, int row,
                   int iterations, const Image<Flow>& found, Flow* flows);

}  // namespace eventcamera
