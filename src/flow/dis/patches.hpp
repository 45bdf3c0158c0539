// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "src/core/image.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/flow/dis/pyramid.hpp"
#include "src/flow/dis/variational_refinement.hpp"

namespace eventcamera {

/// Overlapping square patches of an image, in rows and columns that end at or before the border.
struct PatchGrid {
  PatchGrid(int width, int height, int side_, int stride_)
      : side(side_),
        stride(stride_),
        columns(1 + (width - side_) / stride_),
        rows(1 + (height - side_) / stride_) {}

  int side;  ///< 4 or 8 pixels
  int stride;
  int columns;
  int rows;
};

/// A neighbour's flow is better if its sum of squared differences is below this share of the
/// patch's own sum, by this margin; otherwise rounding would decide in areas without texture.
constexpr float better_share = 0.9F;
constexpr float better_by = 1;

/// Inverse search (Kroeger et al., ECCV 2016) for the patches of a row: gradient descent from
/// `flows`, which are updated. Differences are taken relative to their mean, so brightness may
/// change. A patch that would move farther than its side keeps its flow.
///
/// With `found`, the flows of all patches, patches restart from the best flow of their eight
/// neighbours if it is better than their own (spatial propagation), and keep their own otherwise.
void search_row(const PatchGrid& grid, const Image<std::uint8_t>& from, const Gradients& gradients,
                const Image<std::uint8_t>& to, int row, int iterations, const Image<Flow>* found,
                Flow* flows);

/// Computes rows [first, last) of the dense flow: the mean over the patches that cover a pixel,
/// weighted by how well they match it. The last patches of a row or column extend to the border.
/// `sums` is scratch.
void spread_patches(const PatchGrid& grid, const Image<std::uint8_t>& from,
                    const Image<std::uint8_t>& to, const Image<Flow>& flows, int first, int last,
                    std::vector<float>& sums, VariationalRefinement::Field& out);

}  // namespace eventcamera
