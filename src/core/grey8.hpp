// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/core/luma.hpp"

namespace eventcamera {

/// A frame in 8 bits, which is what optical flow is found in: the frame itself where it has 8,
/// its upper 8 otherwise.
class Grey8 {
 public:
  /// Good as long as `frame` and until the next call.
  ImageView<std::uint8_t> of(const LumaView& frame) {
    if (frame.format.bits == 8) return frame.as<std::uint8_t>();
    const auto picture = frame.as<std::uint16_t>();
    if (upper_.width() != picture.width || upper_.height() != picture.height)
      upper_ = Image<std::uint8_t>(picture.width, picture.height);
    const int shift = frame.format.bits - 8;
    for (int y = 0; y < picture.height; ++y)
      for (int x = 0; x < picture.width; ++x)
        upper_.at(x, y) = static_cast<std::uint8_t>(picture.row(y)[x] >> shift);
    return upper_.view();
  }

 private:
  Image<std::uint8_t> upper_;
};

}  // namespace eventcamera
