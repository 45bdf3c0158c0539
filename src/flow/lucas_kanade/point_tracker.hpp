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

/// The result of tracking a point.
struct Track {
  Flow flow;
  bool found;  ///< false: the point was lost
};

/// Pyramidal Lucas-Kanade from the last picture to the next, each point on its own: 15x15 pixels on
/// 4 levels, as in the paper's code. 8-bit pictures, all of the same size.
class PointTracker {
 public:
  /// Makes `picture` the one tracked to, and the previous one the one tracked from.
  void push(const ImageView<std::uint8_t>& picture, ThreadPool& threads);

  /// Tracks points of the last picture, unique and in raster order, into the next, after two
  /// push(). A track per point, valid until the next call; the same for any number of threads.
  std::span<const Track> track(std::span<const Point> points, ThreadPool& threads);

 private:
  /// Pixels that are tracked together: on the coarsest level, a tile for each fraction of a pixel;
  /// on the others several.
  static constexpr int block_side = Tile::side << (Pyramid::max_levels - 1);
  static constexpr int tiles_a_block = 1 << 2 * (Pyramid::max_levels - 1);

  /// The points of a block, ordered by their tiles on a level.
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
