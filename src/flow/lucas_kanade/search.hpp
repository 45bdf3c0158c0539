// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

#include "src/flow/dense_flow.hpp"
#include "src/flow/lucas_kanade/pyramid.hpp"

namespace eventcamera {

/// 8x8 blocks of a level that begin two pixels apart: blocks of 2x2 pixels, or every other pixel of
/// every other row. The window of a block is the 16x16 pixels around it.
struct Tile {
  static constexpr int side = 8;          ///< blocks
  static constexpr int width = 2 * side;  ///< pixels
  static constexpr int block_count = side * side;
  static constexpr int window = 16;
  /// Pixels of a window before and after the first pixel of its block.
  static constexpr int before = 7;
  static constexpr int after = 8;

  int left;  ///< first pixel
  int top;
};

/// Search for a block of a tile on the same level of another image.
struct Search {
  int x;  ///< position among the blocks of the tile
  int y;
  Flow flow;   ///< in: start of the search; out: its result, if found
  bool found;  ///< out: false if the window has too little texture or left the image
};

/// Lucas-Kanade on one level (Lucas and Kanade 1981; Bouguet 2001): moves a window towards the
/// minimum of its squared difference, at most 11 times, until a move is shorter than 0.03 pixels,
/// reverses the last one, or is longer than 2 pixels after 4 others. Needs the gradients of `from`
/// in all windows. At most one search per block, in raster order.
///
/// The window sum that determines a move is bilinear in the window's position, so it is
/// interpolated between the integer sums at the four pixels around it. The window is summed once
/// per pixel that a search visits, not once per move, and results are the same on every processor.
/// Where several blocks have the same displacement, the windows of all blocks of the tile are
/// summed together.
void search_tile(const Image<std::uint8_t>& from, const ScharrGradients& gradients,
                 const Image<std::uint8_t>& to, const Tile& tile, std::span<Search> searches);

}  // namespace eventcamera
