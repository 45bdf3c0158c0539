// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/flow/lucas_kanade/point_tracker.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera {

/// Position of a pixel after j steps from p, rounded to whole pixels.
inline int moved(int p, Motion motion, int j) {
  return static_cast<int>(
      ((static_cast<std::int64_t>(p) << 16) + static_cast<std::int64_t>(motion) * j + (1 << 15)) >>
      16);
}

/// A tracked pixel that stays within the frame through all steps of an interval.
struct MovingPoint {
  Point start;
  Motion dx;
  Motion dy;

  Point at(int j) const { return {moved(start.x, dx, j), moved(start.y, dy, j)}; }
};

/// Returns the motion along a track; none if the track was lost or leaves the frame.
inline std::optional<MovingPoint> moving_point(const Point& start, const Track& track, int steps,
                                               int width, int height) {
  if (!track.found) return std::nullopt;
  const MovingPoint point{start, motion_per_step(track.flow.x, steps),
                          motion_per_step(track.flow.y, steps)};
  const Point end = point.at(steps);
  if (end.x < 0 || end.x >= width || end.y < 0 || end.y >= height) return std::nullopt;
  return point;
}

/// List of moving points, packed so that the positions of several are computed at once.
class MovingPoints {
 public:
  void clear() { size_ = 0; }

  void push_back(const MovingPoint& point) {
    const std::size_t lane = size_ % block_size;
    const std::size_t index = size_++ / block_size;
    if (index == blocks_.size()) blocks_.emplace_back();
    auto& block = blocks_[index];
    block.x[lane] = point.start.x;
    block.y[lane] = point.start.y;
    block.dx[lane] = point.dx;
    block.dy[lane] = point.dy;
  }

  /// Number of chunks of chunk_size points; the last one may have fewer.
  std::size_t chunks() const { return (size_ + chunk_size - 1) / chunk_size; }

  /// Returns the positions of a chunk after j steps, as pixel indices in an image whose rows are
  /// `stride` pixels apart. Valid as long as `memory` is not changed.
  std::span<const std::int32_t> at(int j, int stride, std::size_t chunk,
                                   std::vector<std::int32_t>& memory) const;

  static constexpr std::size_t chunk_size = 1024;
  static constexpr std::size_t block_size = 16;
  struct alignas(64) Block {
    std::int32_t x[block_size];
    std::int32_t y[block_size];
    Motion dx[block_size];
    Motion dy[block_size];
  };

 private:
  std::vector<Block> blocks_;  ///< those past the end are not in use
  std::size_t size_ = 0;
};

}  // namespace eventcamera
