// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

namespace eventcamera {

/// Somebody else's picture of one channel, read where it lies: any stride, never converted.
template <class Pixel>
struct PlaneView {
  const Pixel* data = nullptr;
  std::ptrdiff_t stride = 0;  ///< bytes from one row to the next
  int width = 0;
  int height = 0;

  const Pixel* row(int y) const {
    return reinterpret_cast<const Pixel*>(reinterpret_cast<const std::byte*>(data) + y * stride);
  }
};

/// A picture of one channel that owns its pixels. Some bytes behind the last one may be read too
/// (they are 0), so that SIMD code need not care where the picture ends.
template <class Pixel>
class Plane {
 public:
  static constexpr std::size_t readable_behind = 64;  ///< bytes

  Plane() = default;
  /// All pixels 0.
  Plane(int width, int height)
      : pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) +
                readable_behind / sizeof(Pixel)),
        width_(width),
        height_(height) {}

  int width() const { return width_; }
  int height() const { return height_; }
  std::ptrdiff_t stride() const { return width_ * static_cast<std::ptrdiff_t>(sizeof(Pixel)); }
  Pixel* row(int y) { return pixels_.data() + static_cast<std::size_t>(y) * width_; }
  const Pixel* row(int y) const { return pixels_.data() + static_cast<std::size_t>(y) * width_; }
  Pixel& at(int x, int y) { return row(y)[x]; }
  const Pixel& at(int x, int y) const { return row(y)[x]; }
  PlaneView<Pixel> view() const { return {pixels_.data(), stride(), width_, height_}; }

  /// Copies a picture of the same size.
  void assign(const PlaneView<Pixel>& other) {
    for (int y = 0; y < height_; ++y)
      std::memcpy(row(y), other.row(y), static_cast<std::size_t>(stride()));
  }

 private:
  std::vector<Pixel> pixels_;
  int width_ = 0;
  int height_ = 0;
};

}  // namespace eventcamera
