// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// A picture and its halves, blurred with (1 4 6 4 1) / 16 each way and subsampled by 2, while both
/// sides are longer than `min_side`; at most `max_levels`.
class Pyramid {
 public:
  /// The picture, reflected at its border, and its slopes by Scharr's operator, in 1/32 of a grey
  /// level per pixel and 0 beyond the border. All with a margin.
  struct Level {
    Image<std::uint8_t> picture;
    Image<std::int16_t> slope_x;
    Image<std::int16_t> slope_y;
  };

  static constexpr int margin = 16;  ///< how far windows reach over the border
  static constexpr int max_levels = 4;
  static constexpr int min_side = 15;

  /// Computes the levels of a picture of any size; reuses the memory of one of the same size.
  void build(const ImageView<std::uint8_t>& picture, ThreadPool& threads);

  /// Computes the slopes, which only the picture tracked from needs.
  void build_slopes(ThreadPool& threads);

  const std::vector<Level>& levels() const { return levels_; }

 private:
  void shape(int width, int height);

  std::vector<Level> levels_;
};

}  // namespace eventcamera
