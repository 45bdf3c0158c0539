// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "src/core/image.hpp"

namespace eventcamera {

/// 24-bit RGB image, initially black.
class RgbPicture {
 public:
  RgbPicture(int width, int height)
      : width_(width),
        height_(height),
        pixels_(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

  int width() const { return width_; }
  int height() const { return height_; }

  /// Bytes of a row: red, green and blue of each pixel.
  std::uint8_t* row(int y) { return pixels_.data() + offset(y); }
  const std::uint8_t* row(int y) const { return pixels_.data() + offset(y); }

  /// The bytes of a PNG file. Throws std::runtime_error with the reason.
  std::string png() const;

 private:
  std::size_t offset(int y) const {
    return 3 * static_cast<std::size_t>(y) * static_cast<std::size_t>(width_);
  }

  int width_;
  int height_;
  std::vector<std::uint8_t> pixels_;
};

/// Draws the event count per pixel, from black (none) to light yellow (99.5 % quantile of the
/// pixels with events), and below it a bar of these colours with that count.
RgbPicture draw_map(const Image<std::uint32_t>& map);

/// Draws the reference, the candidate and their difference side by side, on the same scale, with
/// bars: blue if the candidate has more events, red if it has fewer.
RgbPicture draw_maps(const Image<std::uint32_t>& reference, const Image<std::uint32_t>& candidate);

}  // namespace eventcamera
