// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "src/flow/lucas_kanade/pyramid.hpp"
#include "src/flow/lucas_kanade/search.hpp"

namespace eventcamera {

struct Point {
  int x;
  int y;
};

/// Where a tracked point went.
struct Track {
  Flow flow;
  bool found;  ///< false: the point was lost
};

/// Pyramidal Lucas-Kanade from the last picture to the next: 15x15 pixels on 4 levels, as in the
/// paper's code, each point on its own. 8-bit pictures of one size, any size.
class PointTracker {
 public:
  /// Makes the next picture the one tracked to, and what was the next the one tracked from.
  void push(const ImageView<std::uint8_t>& picture, ThreadPool& threads);

  /// Follows points of the last picture, in raster order and each once, into the next, after two
  /// push(). A track for each point, good until the next call, the same for any number of threads.
  std::span<const Track> track(std::span<const Point> points, ThreadPool& threads);

 private:
  /// Pixels that are followed together: on the uppermost level the points of each fraction of a
  /// pixel are a tile, on the others several.
  static constexpr int block_side = Tile::side << (Pyramid::max_levels - 1);
  static constexpr int tiles_a_block = 1 << 2 * (Pyramid::max_levels - 1);

  /// The points of a block, in the order of the tiles that they are in on a level.
  struct Block {
    std::vector<std::uint32_t> points;
    std::vector<std::uint32_t> ordered;
  };

  void find_rows(std::span<const Point> points, int height);
  void follow(std::span<const Point> points, int left, int top, Block& block);
  void search(std::span<const Point> points, std::size_t level, int left, int top, Block& block);

  Pyramid last_;
  Pyramid next_;
  bool has_slopes_ = false;
  std::vector<std::size_t> rows_;  ///< where the points of each row begin
  std::vector<Block> blocks_;      ///< one a thread
  std::vector<Track> tracks_;
};

}  // namespace eventcamera
