// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
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

struct Track {
  Flow flow{};         ///< meaningless if not found
  bool found = false;  ///< false: the point was lost
};

/// Pyramidal Lucas-Kanade from the last image to the next, on 4 levels. 8-bit images, all of the
/// same size.
///
/// Tracks blocks of 2x2 pixels, or single pixels, with a window of 16x16 pixels. The search for a
/// block starts at twice the flow of the block of the coarser level that contains it; a lost block
/// keeps the flow that its search started from.
///
/// A point takes the flow of its block. With blocks of 2x2 pixels, it adds a quarter of the
/// difference to the nearer horizontal neighbour of the block, and to the nearer vertical one.
/// These differences are clipped to half a pixel, and are 0 if the neighbour is not tracked, was
/// lost, or is in another of the regions of 128x128 pixels into which images are divided.
class PointTracker {
 public:
  /// `block_side` is 1 or 2. Blocks of 2x2 pixels take a quarter of the time.
  explicit PointTracker(int block_side) : block_side_(block_side) {}

  /// Makes `image` the image tracked to, and the previous one the image tracked from.
  /// `is_black`, if not empty, is 1 for each row that is known to be 0.
  void push(const ImageView<std::uint8_t>& image, ThreadPool& threads,
            std::span<const std::uint8_t> is_black = {});

  /// Tracks points of the last image, unique and in raster order, into the next. Needs two push()
  /// first. Returns a track per point, valid until the next call; the same for any number of
  /// threads.
  std::span<const Track> track(std::span<const Point> points, ThreadPool& threads);

 private:
  /// Side of a region tracked together, in blocks of the finest level.
  static constexpr int region_side = Tile::side << (Pyramid::max_levels - 1);
  static constexpr int max_block_side = 2;

  /// Blocks of a region on one level.
  class Blocks {
   public:
    Blocks() : tracks_(std::size_t{region_side} * region_side) {}

    void clear();
    void add(int x, int y) { rows_[y] |= std::uint64_t{1} << x; }
    /// Adds the blocks that contain blocks of the next finer level.
    void add_coarser(const Blocks& finer);
    /// Blocks of a row: bit x.
    std::uint64_t row(int y) const { return rows_[y]; }
    /// First and last row with blocks; there must be one.
    int first_row() const;
    int last_row() const;
    /// Columns with blocks, of any row: bit x.
    std::uint64_t columns() const;

    /// Track of a pixel, interpolated between blocks of 2x2 pixels.
    Track interpolated(int x, int y) const;

    Track& track(int x, int y) { return tracks_[index(x, y)]; }
    const Track& track(int x, int y) const { return tracks_[index(x, y)]; }

   private:
    static_assert(region_side == 64);
    static std::size_t index(int x, int y) {
      return static_cast<std::size_t>(y) * region_side + static_cast<std::size_t>(x);
    }

    std::array<std::uint64_t, region_side> rows_{};  ///< bit x of row y
    std::vector<Track> tracks_;                      ///< not found where there is no block
  };

  /// Memory of one thread.
  struct Region {
    explicit Region(int side)
        : gradients(side + Tile::before + Tile::after, side + Tile::before + Tile::after) {}

    std::array<Blocks, Pyramid::max_levels> levels;
    ScharrGradients gradients;
  };

  void find_rows(std::span<const Point> points, int height);
  void track_region(std::span<const Point> points, int left, int top, Region& region);
  void search(std::size_t level, int left, int top, Region& region) const;
  /// Searches for the blocks of a tile whose first one is (x, y) of its region.
  void search_tile_at(std::size_t level, int left, int top, int x, int y, Region& region) const;

  /// Distance between the blocks of a tile, in blocks.
  int blocks_apart() const { return Tile::width / Tile::side / block_side_; }

  int block_side_;  ///< pixels
  Pyramid last_;
  Pyramid next_;
  std::vector<std::size_t> rows_;  ///< index of the first point of each row
  std::vector<Region> regions_;    ///< one per thread
  std::vector<Track> tracks_;
};

}  // namespace eventcamera
