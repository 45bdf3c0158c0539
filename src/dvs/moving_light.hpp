// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"
#include "src/dvs/pixel_array.hpp"
#include "src/flow/dense_flow.hpp"
#include "src/simulate/warp.hpp"

namespace eventcamera {

/// Tiles of a frame, each with its own number of steps, so that one fast object does not subdivide
/// the whole frame.
class MotionTiles {
 public:
  /// Pixels of a tile; at the right and lower border it may have fewer.
  static constexpr int width = 32;
  static constexpr int height = 8;
  static_assert(rows_per_band % height == 0);

  /// Computes the number of steps of each tile, at most `max_steps`.
  void measure(const ImageView<Flow>& flow, int max_steps, ThreadPool& threads);

  int columns() const { return steps_.width(); }
  int rows() const { return steps_.height(); }
  int steps(int column, int row) const { return steps_.at(column, row); }

 private:
  Image<std::int32_t> steps_;
};

/// Writes the luma of a run of pixels that move along the flow: a row for each blended frame j = 1
/// ... steps - 1, at out + (j - 1) * stride. 8-bit frames (views of Images) are widened to 16 bits,
/// to keep more shades in dark areas; deeper frames keep their depth. Rows of `out` must have 8
/// elements past their end.
void move_light(const Warp<std::uint8_t>& warp, const ImageView<Flow>& flow, const Run& run,
                std::uint16_t* out, std::ptrdiff_t stride);
void move_light(const Warp<std::uint16_t>& warp, const ImageView<Flow>& flow, const Run& run,
                std::uint16_t* out, std::ptrdiff_t stride);

/// Converts pixels of a frame to the depth of move_light().
void widen(const std::uint8_t* luma, int count, std::uint16_t* out);
void widen(const std::uint16_t* luma, int count, std::uint16_t* out);

}  // namespace eventcamera
