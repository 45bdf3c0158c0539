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

/// What PointTracker is to take for disagreement, in pixels, so that its tracks end within 0.1
/// pixel of OpenCV's on average where there is texture: between frames, and between difference
/// frames, in which there is less to hold on to.
inline constexpr float disagreement_of_frames = 2;
inline constexpr float disagreement_of_differences = 0.35F;

/// Pyramidal Lucas-Kanade from the last picture to the next: 15x15 pixels on 4 levels, as in the
/// paper's code. 8-bit pictures of one size, any size.
///
/// The windows of neighbours are nearly the same. On each level one search serves a cell of 2x2
/// pixels, and a point's flow is interpolated between the cells about it. Only where those
/// disagree, at the outlines of what moves and where there is little to hold on to, is each point
/// searched for on its own.
class PointTracker {
 public:
  /// Neighbouring cells disagree where their flows differ by more than this, in pixels: the less,
  /// the more points are searched for on their own.
  explicit PointTracker(float disagreement) : disagreement_(disagreement) {}

  /// Makes the next picture the one tracked to, and what was the next the one tracked from.
  void push(const PlaneView<std::uint8_t>& picture, ThreadPool& threads);

  /// Follows points of the last picture, in raster order, into the next, after two push(). A track
  /// for each point, good until the next call, the same for any number of threads.
  std::span<const Track> track(std::span<const Point> points, ThreadPool& threads);

 private:
  /// 2x2 pixels of a level.
  struct Cell {
    Flow flow;
    bool found;
    std::uint32_t call = 0;  ///< the last track() that wanted it
  };
  struct CellGrid {
    int width;
    int height;
    std::vector<Cell> cells;
    std::vector<Point> wanted;  ///< by this call, in no order that matters

    Cell& at(const Point& cell) { return cells[index(cell)]; }
    const Cell& at(const Point& cell) const { return cells[index(cell)]; }

    std::size_t index(const Point& cell) const {
      return static_cast<std::size_t>(cell.y) * static_cast<std::size_t>(width) +
             static_cast<std::size_t>(cell.x);
    }
  };

  void want_cells(std::span<const Point> points);
  void search_cells(std::size_t level, ThreadPool& threads);
  Flow guess(const CellGrid& above, const Point& cell) const;
  const Cell* wanted_cell(const CellGrid& grid, int x, int y) const;
  bool interpolate(const Point& point, Track& track) const;
  void search_alone(std::span<const Point> points, ThreadPool& threads);

  float disagreement_;
  Pyramid last_;
  Pyramid next_;
  bool has_slopes_ = false;
  std::vector<CellGrid> grids_;  ///< one a level
  std::uint32_t call_ = 0;
  std::vector<Search> searches_;
  std::vector<std::uint8_t> agreed_;
  std::vector<std::size_t> alone_;
  std::vector<Track> tracks_;
};

}  // namespace eventcamera
