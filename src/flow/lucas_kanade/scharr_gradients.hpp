// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>

#include "src/core/image.hpp"

namespace eventcamera {

/// Scharr gradients of a part of an image, in 1/32 of a grey level per pixel; 0 beyond the border.
class ScharrGradients {
 public:
  /// For boxes of at most this size.
  ScharrGradients(int max_width, int max_height)
      : x_(max_width, max_height), y_(max_width, max_height) {}

  /// Computes the gradients in `box`, except columns more than `margin` pixels past the right
  /// border. The image must be reflected at its border.
  void compute(const Image<std::uint8_t>& image, const Box& box);

  /// Row y of the image.
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
