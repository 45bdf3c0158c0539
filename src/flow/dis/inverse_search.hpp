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

}  // namespace eventcamera
