// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "src/flow/lucas_kanade/pyramid.hpp"
#include "src/flow/lucas_kanade/scharr_gradients.hpp"
#include "src/flow/lucas_kanade/search.hpp"

namespace eventcamera {

struct Point {
  int x;
  int y;
};

/// Result of tracking a point.
struct Track {
  Flow flow{};         ///< meaningless if not found
  bool found = false;  ///< false: the point was lost
};

/// Pyramidal Lucas-Kanade from the last image to the next, each point independently: windows of
/// 15x15 pixels on 4 levels, as in the paper's code. 8-bit images, all of the same size.
class PointTracker {
 public:
  /// Makes `picture` the image tracked to, and the previous one the image tracked from.
  void push(const ImageView<std::uint8_t>& picture, ThreadPool& threads);

  /// Tracks points of the last image, unique and in raster order, into the next. Needs two push()
  /// first. Returns a track per point, valid until the next call; the same for any number of
  /// threads.
  std::span<const Track> track(std::span<const Point> points, ThreadPool& threads);

 private:
  /// Side of a block of pixels tracked together: on the coarsest level, one tile per sub-pixel
  /// offset; on finer levels, more tiles and fewer offsets.
  static constexpr int block_side = Tile::side << (Pyramid::max_levels - 1);
  static constexpr int tiles_a_block = 1 << 2 * (Pyramid::max_levels - 1);

  struct Block {
    std::vector<std::uint32_t> points;
    std::vector<std::uint32_t> ordered;  ///< the same by their tiles on a level
    ScharrGradients gradients;           ///< of a level, in the windows of the points
  };

  void find_rows(std::span<const Point> points, int height);
  void follow(std::span<const Point> points, int left, int top, Block& block);
  /// Drops the points that the search on the finest level would lose for lack of texture, before
  /// they are tracked on the coarser levels.
  void drop_flat(std::span<const Point> points, int left, int top, Block& block);
  void search(std::span<const Point> points, std::size_t level, int left, int top, Block& block);

  Pyramid last_;
  Pyramid next_;
  std::vector<std::size_t> rows_;  ///< index of the first point of each row
  std::vector<Block> blocks_;      ///< one per thread
  std::vector<Track> tracks_;
};

}  // namespace eventcamera
