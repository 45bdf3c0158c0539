// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Weights of the colours in luma, in units of 1/one.
struct LumaWeights {
  static constexpr int bits = 15;
  static constexpr std::int32_t one = 1 << bits;

  std::int32_t red;
  std::int32_t green;
  std::int32_t blue;

  /// Weights from Kr and Kb of a colour matrix. Their sum is `one`, so that grey keeps its value.
  static LumaWeights of(double kr, double kb) {
    const auto red = static_cast<std::int32_t>(std::lround(kr * one));
    const auto blue = static_cast<std::int32_t>(std::lround(kb * one));
    return {red, one - red - blue, blue};
  }
};

/// One colour of a frame: a plane, or an offset in interleaved samples.
struct ColourView {
  const void* data = nullptr;  ///< first pixel of the plane
  std::ptrdiff_t stride = 0;   ///< bytes from one row to the next
  int place = 0;               ///< index of the sample in its pixel
};

/// Non-owning view of a frame with colour samples of 8 or 16 bits.
struct RgbView {
  int samples = 1;  ///< per pixel: 3 or 4 if interleaved, 1 if each colour has its own plane
  ColourView red;
  ColourView green;
  ColourView blue;
};

/// Non-owning view of a frame with one 16-bit word per pixel: 5 bits each of red and blue, and 5 or
/// 6 bits of green in between.
struct RgbWordsView {
  const void* data = nullptr;
  std::ptrdiff_t stride = 0;  ///< bytes from one row to the next
  int green_bits = 6;
  bool is_blue_first = false;  ///< blue is in the upper bits
};

/// Computes the luma of a frame of the size of `out`: (weights * colours + one / 2) / one, rounded
/// down. Colours of words are expanded to 8 bits by repeating their upper bits.
void luma_of_rgb(const RgbView& frame, const LumaWeights& weights, ThreadPool& threads,
                 Image<std::uint8_t>& out);
void luma_of_rgb(const RgbView& frame, const LumaWeights& weights, ThreadPool& threads,
                 Image<std::uint16_t>& out);
void luma_of_rgb(const RgbWordsView& frame, const LumaWeights& weights, ThreadPool& threads,
                 Image<std::uint8_t>& out);

}  // namespace eventcamera
