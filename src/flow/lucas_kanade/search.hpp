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
  int right;  ///< what every point lies beyond its pixel, in eighths
  int down;
};

/// A point of a tile on its way into the same level of another picture.
struct Search {
  int x;  ///< its pixel, within the tile
  int y;
  Flow flow;   ///< in: where the search starts; out: where it ended
  bool found;  ///< out: false where the window has too little texture or has left the picture
};

/// Lucas-Kanade on one level (Lucas and Kanade 1981; Bouguet 2001): a window of 15x15 pixels is
/// moved until its squared difference no longer falls; at most 10 times, or until a move is shorter
/// than 0.03 pixel or turns back. Needs `from`'s slopes. No more searches than a tile has pixels.
///
/// The sum over the window that a move follows from is bilinear in where the window lies: between
/// its values with the window on the four pixels about it, which are integers. So a window is gone
/// through once for each pixel that a search comes by, not once a move, and the rest is a little
/// floating point, the same on every processor.
void search_tile(const Pyramid::Level& from, const Pyramid::Level& to, const Tile& tile,
                 std::span<Search> searches);

}  // namespace eventcamera
