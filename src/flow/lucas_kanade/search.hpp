// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

#include "src/flow/dense_flow.hpp"
#include "src/flow/lucas_kanade/scharr_gradients.hpp"

namespace eventcamera {

/// 16x16 pixels of a level. Points of a tile that share a sub-pixel offset are searched for
/// together.
struct Tile {
  static constexpr int side = 16;
  static constexpr int fractions = 8;  ///< points lie at multiples of 1/8 of a pixel
  /// Pixels of a window on either side of the point's pixel.
  static constexpr int before = 7;
  static constexpr int after = 8;

  int left;
  int top;
  int right;  ///< offset of every point from its pixel, in 1/8
  int down;
};

/// Search for a point of a tile on the same level of another image.
struct Search {
  int x;  ///< its pixel, within the tile
  int y;
  Flow flow;   ///< in: start of the search; out: its result
  bool found;  ///< out: false if the window has too little texture or left the image
};

/// Lucas-Kanade on one level (Lucas and Kanade 1981; Bouguet 2001): moves a window of 15x15 pixels
/// towards the minimum of its squared difference, at most 10 times, until a move is shorter than
/// 0.03 pixels or undoes the last one. Needs the gradients of `from` in all windows. At most one
/// search per pixel of the tile.
///
/// The window sum that determines a move is bilinear in the window's position, so it is
/// interpolated between the integer sums at the four pixels around it. The window is summed once
/// per pixel that a search visits, not once per move, and results are the same on every processor.
/// Where many points have moved alike, the windows of all pixels of the tile are summed together.
void search_tile(const Image<std::uint8_t>& from, const ScharrGradients& gradients,
                 const Image<std::uint8_t>& to, const Tile& tile, std::span<Search> searches);

}  // namespace eventcamera
