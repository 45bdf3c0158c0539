// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "src/simulate/motion.hpp"

namespace eventcamera {

/// A list of moving points, packed so that the positions of several are computed at once.
class MovingPoints {
 public:
  /// Removes all points but keeps their memory.
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

  /// Computes the positions of a chunk after j steps as indices of the pixels of an image whose
  /// rows are `stride` pixels apart. Valid as long as `memory` is not changed.
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
