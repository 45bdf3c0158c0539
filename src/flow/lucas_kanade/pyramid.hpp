// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "src/core/plane.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// A picture with a margin around it that may be read, so that a window may reach over the border.
template <class Pixel>
class PlaneWithMargin {
 public:
  static constexpr int margin = 16;        ///< above, below and to the left
  static constexpr int right_margin = 32;  ///< a vector more

  PlaneWithMargin() = default;
  /// All pixels 0.
  PlaneWithMargin(int width, int height)
      : stride_(margin + width + right_margin),
        width_(width),
        height_(height),
        pixels_(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(height + 2 * margin)) {
  }

  int width() const { return width_; }
  int height() const { return height_; }
  /// Row -margin ... height() + margin - 1, readable from column -margin.
  Pixel* row(int y) { return pixels_.data() + (y + margin) * stride_ + margin; }
  const Pixel* row(int y) const { return pixels_.data() + (y + margin) * stride_ + margin; }

 private:
  std::ptrdiff_t stride_ = 0;
  int width_ = 0;
  int height_ = 0;
  std::vector<Pixel> pixels_;
};

/// A picture and its halves, blurred with (1 4 6 4 1) / 16 each way and every second pixel taken,
/// as long as both sides are longer than `min_side`; at most `max_levels`.
class Pyramid {
 public:
  /// The picture, reflected about its border pixels beyond them, and its slopes by Scharr's
  /// operator, 32 times a grey level a pixel, 0 beyond the border.
  struct Level {
    PlaneWithMargin<std::uint8_t> picture;
    PlaneWithMargin<std::int16_t> slope_x;
    PlaneWithMargin<std::int16_t> slope_y;
  };

  static constexpr int max_levels = 4;
  static constexpr int min_side = 15;

  /// Makes the levels, of a picture of any size; keeps the memory of one of the same size.
  void build(const PlaneView<std::uint8_t>& picture, ThreadPool& threads);

  /// Makes the slopes, which only a picture tracked from needs.
  void build_slopes(ThreadPool& threads);

  const std::vector<Level>& levels() const { return levels_; }

 private:
  void shape(int width, int height);

  std::vector<Level> levels_;
};

}  // namespace eventcamera
