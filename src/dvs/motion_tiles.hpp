// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"
#include "src/flow/dense_flow.hpp"

namespace eventcamera {

/// Tiles of a frame, each of which moves in steps of its own, so that one long vector does not
/// divide the time of a whole frame.
class MotionTiles {
 public:
  /// Pixels of a tile; at the right and lower border it may have fewer.
  static constexpr int width = 32;
  static constexpr int height = 8;
  static_assert(rows_per_band % height == 0);

  struct Tile {
    int steps;      ///< between two frames, of a pixel along an axis; longer where much moves
    int darkest;    ///< minimum luma along the way of any pixel, in both frames
    int brightest;  ///< maximum luma along that way
  };

  /// Measures the motion between two frames of the same size. A tile has at most `max_steps` steps.
  template <class Pixel>
  void measure(const ImageView<Pixel>& last, const ImageView<Pixel>& now,
               const ImageView<Flow>& flow, int max_steps, ThreadPool& threads);

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  const Tile& at(int column, int row) const {
    return tiles_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                  static_cast<std::size_t>(column)];
  }

 private:
  /// Minimum and maximum luma of each cell of a frame.
  struct Cells {
    static constexpr int side = 8;
    Image<std::uint16_t> darkest;
    Image<std::uint16_t> brightest;

    template <class Pixel>
    void measure(const ImageView<Pixel>& frame, ThreadPool& threads);
    /// Widens the range of `tile` to that of `box`, which may extend beyond the frame.
    void add_range_of(const Box& box, Tile& tile) const;
  };

  int columns_ = 0;
  int rows_ = 0;
  std::vector<Tile> tiles_;
  Cells last_;
  Cells now_;
};

}  // namespace eventcamera
