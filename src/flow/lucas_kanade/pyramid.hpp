// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// A picture and its halves, blurred with (1 4 6 4 1) / 16 each way and every second pixel taken,
/// as long as both sides are longer than `min_side`; at most `max_levels`.
class Pyramid {
 public:
  /// The picture, reflected about its border pixels beyond them, and its slopes by Scharr's
  /// operator, 32 times a grey level a pixel, 0 beyond the border.
  struct Level {
    Image<std::uint8_t> picture;
    Image<std::int16_t> slope_x;
    Image<std::int16_t> slope_y;
  };

  static constexpr int margin = 16;  ///< of the images of a level: a window reaches over the border
  static constexpr int max_levels = 4;
  static constexpr int min_side = 15;

  /// Makes the levels, of a picture of any size; keeps the memory of one of the same size.
  void build(const ImageView<std::uint8_t>& picture, ThreadPool& threads);

  /// Makes the slopes, which only a picture tracked from needs.
  void build_slopes(ThreadPool& threads);

  const std::vector<Level>& levels() const { return levels_; }

 private:
  void shape(int width, int height);

  std::vector<Level> levels_;
};

}  // namespace eventcamera
