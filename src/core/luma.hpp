// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>

#include "src/core/image.hpp"

namespace eventcamera {

/// What stays the same from one frame of a stream to the next.
struct LumaFormat {
  int width = 0;
  int height = 0;
  int bits = 8;  ///< 8: a byte a pixel; 9 to 16: a 16-bit word a pixel, white is 2^bits - 1

  friend bool operator==(const LumaFormat&, const LumaFormat&) = default;
};

/// The brightness of one frame, where it lies.
struct LumaView {
  LumaFormat format;
  const void* data = nullptr;
  std::ptrdiff_t stride = 0;  ///< bytes from one row to the next

  /// Pixel is std::uint8_t where format.bits is 8, std::uint16_t otherwise.
  template <class Pixel>
  ImageView<Pixel> as() const {
    return {static_cast<const Pixel*>(data), stride, format.width, format.height};
  }
};

/// Gathers the luma of a packed 4:2:2 picture (YUY2, UYVY, ...), whose luma is every second byte
/// from `data` on: the one layout whose luma is no plane.
void unpack_luma(const std::uint8_t* data, std::ptrdiff_t stride, Image<std::uint8_t>& out);

}  // namespace eventcamera
