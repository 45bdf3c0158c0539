// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/core/luma.hpp"
#include "src/core/rgb_luma.hpp"
#include "src/gl/objects.hpp"

namespace eventcamera::gl {

/// Input frame of a simulator, a 2D texture of bytes.
struct TextureFrame {
  LumaFormat format;
  GLuint texture;
  /// Weights of the four channels in luma, in units of 1/LumaWeights::one. Their sum is
  /// LumaWeights::one.
  int weights[4];
  int alpha = -1;  ///< channel of alpha; -1: opaque
  int black = 0;   ///< luma of black, on which the frame is composited
};

inline std::size_t pixel_count(const LumaFormat& format) {
  return static_cast<std::size_t>(format.width) * static_cast<std::size_t>(format.height);
}

/// The luma of a frame: bytes, four per word; each row starts with a new word.
class GreyFrame {
 public:
  GreyFrame(const Context& gl, const LumaFormat& format) : buffer_(gl) {
    buffer_.reserve(static_cast<std::size_t>(words_across(format.width)) *
                    static_cast<std::size_t>(format.height) * 4);
  }

  static int words_across(int width) { return groups_of(4, width); }
  const Buffer& buffer() const { return buffer_; }

 private:
  Buffer buffer_;
};

}  // namespace eventcamera::gl
