// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>

namespace eventcamera {

/// The pixels [left, right) x [top, bottom) of an image.
struct Box {
  int left = 0;
  int top = 0;
  int right = 0;
  int bottom = 0;

  int width() const { return right - left; }
  int height() const { return bottom - top; }
  bool empty() const { return width() <= 0 || height() <= 0; }

  friend bool operator==(const Box&, const Box&) = default;
};

/// Non-owning view of a single-channel image. Any stride; nothing past the last pixel of a row may
/// be read.
template <class Pixel>
struct ImageView {
  const Pixel* data = nullptr;
  std::ptrdiff_t stride = 0;  ///< bytes from one row to the next
  int width = 0;
  int height = 0;

  const Pixel* row(int y) const {
    return reinterpret_cast<const Pixel*>(reinterpret_cast<const std::byte*>(data) + y * stride);
  }
};

/// Single-channel image that owns its pixels, with an optional margin around them.
///
/// Rows start on a cache line. At least 64 bytes and 16 pixels past the end of a row (and its
/// margin) may be read and written, so that kernels can load and store whole vectors up to the end
/// of any row. They are initially 0. Pages are allocated on the first write.
template <class Pixel>
class Image {
 public:
  Image() = default;
  /// All pixels 0. Rows -margin ... height + margin - 1 and columns -margin ... width + margin - 1
  /// exist.
  Image(int width, int height, int margin = 0)
      : width_(width), height_(height), margin_(margin), stride_(padded_stride()) {
    memory_.reset(static_cast<std::byte*>(std::calloc(1, size() + line_size)));
    if (!memory_) throw std::bad_alloc();
    bytes_ =
        memory_.get() + line_size - reinterpret_cast<std::uintptr_t>(memory_.get()) % line_size;
  }
  Image(const Image& other) : Image(other.width_, other.height_, other.margin_) {
    if (other.bytes_ != nullptr) std::memcpy(bytes_, other.bytes_, size());
  }
  Image(Image&&) noexcept = default;
  Image& operator=(const Image& other) {
    if (this != &other) *this = Image(other);
    return *this;
  }
  Image& operator=(Image&&) noexcept = default;
  ~Image() = default;

  int width() const { return width_; }
  int height() const { return height_; }
  int margin() const { return margin_; }
  /// Bytes from one row to the next.
  std::ptrdiff_t stride() const { return stride_; }
  Pixel* row(int y) { return reinterpret_cast<Pixel*>(bytes_ + offset(y)); }
  const Pixel* row(int y) const { return reinterpret_cast<const Pixel*>(bytes_ + offset(y)); }
  Pixel& at(int x, int y) { return row(y)[x]; }
  const Pixel& at(int x, int y) const { return row(y)[x]; }
  ImageView<Pixel> view() const { return {row(0), stride_, width_, height_}; }

  /// Copies an image of the same size.
  void assign(const ImageView<Pixel>& other) {
    for (int y = 0; y < height_; ++y) assign_row(y, other.row(y));
  }
  void assign_row(int y, const Pixel* from) {
    std::memcpy(row(y), from, static_cast<std::size_t>(width_) * sizeof(Pixel));
  }

 private:
  static constexpr std::ptrdiff_t line_size = 64;
  struct Free {
    void operator()(std::byte* memory) const { std::free(memory); }
  };

  static std::ptrdiff_t whole_lines(std::ptrdiff_t bytes) {
    return (bytes + line_size - 1) / line_size * line_size;
  }
  std::ptrdiff_t left_margin() const {
    return whole_lines(margin_ * static_cast<std::ptrdiff_t>(sizeof(Pixel)));
  }
  std::ptrdiff_t padded_stride() const {
    constexpr auto pixel = static_cast<std::ptrdiff_t>(sizeof(Pixel));
    constexpr std::ptrdiff_t page = 2048;
    const auto padding = std::max(line_size, 16 * pixel);
    const auto stride = left_margin() + whole_lines((width_ + margin_) * pixel + padding);
    return stride % page == 0 ? stride + line_size : stride;  // rows must not share a cache set
  }
  std::size_t size() const {
    return static_cast<std::size_t>(height_ + 2 * margin_) * static_cast<std::size_t>(stride_);
  }
  std::ptrdiff_t offset(int y) const { return (y + margin_) * stride_ + left_margin(); }

  int width_ = 0;
  int height_ = 0;
  int margin_ = 0;
  std::ptrdiff_t stride_ = 0;
  std::unique_ptr<std::byte, Free> memory_;
  std::byte* bytes_ = nullptr;
};

}  // namespace eventcamera
