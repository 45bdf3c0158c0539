// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Gaussian pyramid of an image, reflected at its border: each level is the previous one blurred
/// with (1 4 6 4 1) / 16 each way and subsampled by 2. It ends before a side of min_side or less,
/// or at max_levels.
class Pyramid {
 public:
  static constexpr int margin = 16;  ///< pixels that windows may extend past the border
  static constexpr int max_levels = 4;
  static constexpr int min_side = 15;

  /// Computes the levels of an image of any size; images of the same size reuse the memory.
  /// `is_black`, if not empty, is 1 for each row that is known to be 0; rows that stay black on a
  /// level are skipped.
  void build(const ImageView<std::uint8_t>& image, ThreadPool& threads,
             std::span<const std::uint8_t> is_black = {});

  const std::vector<Image<std::uint8_t>>& levels() const { return levels_; }

 private:
  void shape(int width, int height);
  template <class MakeRow>
  void build_level(std::size_t level, ThreadPool& threads, const MakeRow& make_row);

  std::vector<Image<std::uint8_t>> levels_;
  std::vector<std::vector<std::uint8_t>> is_black_;  ///< 1 for each row of a level that is 0
};

/// Scharr gradients of a part of an image, in 1/32 of a grey level per pixel; 0 beyond the border.
class ScharrGradients {
 public:
  /// For boxes of at most this size.
  ScharrGradients(int max_width, int max_height)
      : x_(max_width, max_height), y_(max_width, max_height) {}

  /// Computes the gradients in `box`, except columns more than `margin` pixels past the right
  /// border. The image must be reflected at its border.
  void compute(const Image<std::uint8_t>& image, const Box& box);

  const std::int16_t* x(int y) const { return x_.row(y - box_.top) - box_.left; }
  const std::int16_t* y(int y) const { return y_.row(y - box_.top) - box_.left; }
  /// Elements from one row to the next.
  std::ptrdiff_t stride() const {
    return x_.stride() / static_cast<std::ptrdiff_t>(sizeof(std::int16_t));
  }

  static constexpr int margin = 8;

 private:
  Image<std::int16_t> x_;
  Image<std::int16_t> y_;
  Box box_;
};

}  // namespace eventcamera
