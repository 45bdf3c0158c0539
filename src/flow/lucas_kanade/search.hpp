// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <span>

#include "src/flow/dense_flow.hpp"
#include "src/flow/lucas_kanade/pyramid.hpp"

namespace eventcamera {

/// A point of one pyramid level on its way into the same level of another picture.
struct Search {
  float x;  ///< where it is, within the level
  float y;
  Flow flow;   ///< in: where the search starts; out: where it ended
  bool found;  ///< out: false where the window has too little texture or has left the picture
};

/// Lucas-Kanade on one level (Lucas and Kanade 1981; Bouguet 2001): a window of 15x15 pixels is
/// moved until its squared difference no longer falls; at most 10 times, or until a move is shorter
/// than 0.03 pixel or turns back. Needs `from`'s slopes. In integers but for the 2x2 system: the
/// same on every processor.
void search_level(const Pyramid::Level& from, const Pyramid::Level& to, std::span<Search> searches);

}  // namespace eventcamera
