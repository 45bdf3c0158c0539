// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

#include "src/flow/dense_flow.hpp"
#include "src/flow/lucas_kanade/pyramid.hpp"

namespace eventcamera {

/// 16x16 pixels of a level: points that share a fraction of a pixel are searched for together.
struct Tile {
  static constexpr int side = 16;
  static constexpr int fractions = 8;  ///< a point lies at eighths of a pixel

  int left;
  int top;
  int right;  ///< offset of every point from its pixel, in eighths
  int down;
};

/// The search for a point of a tile on the same level of another picture.
struct Search {
  int x;  ///< its pixel, within the tile
  int y;
  Flow flow;   ///< in: where the search starts; out: where it ended
  bool found;  ///< out: false where the window has too little texture or has left the picture
};

/// Lucas-Kanade on one level (Lucas and Kanade 1981; Bouguet 2001): a window of 15x15 pixels moves
/// until its squared difference no longer falls; at most 10 times, or until a move is shorter than
/// 0.03 pixel or turns back. Needs the slopes of `from`. At most one search per pixel of the tile.
///
/// The sum over a window that determines a move is bilinear in the window's position: interpolated
/// between the sums at the four pixels around it, which are integers. So the window is summed once
/// per pixel that a search visits, not once per move, and the remaining floating-point arithmetic
/// is the same on every processor.
void search_tile(const Pyramid::Level& from, const Pyramid::Level& to, const Tile& tile,
                 std::span<Search> searches);

}  // namespace eventcamera
