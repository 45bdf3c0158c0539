// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// What the colours contribute to luma, in units of 1/one.
struct LumaWeights {
  static constexpr int bits = 15;
  static constexpr std::int32_t one = 1 << bits;

  std::int32_t red;
  std::int32_t green;
  std::int32_t blue;

  /// Of a colour matrix's Kr and Kb. They add up to one, so grey keeps its value.
  static LumaWeights of(double kr, double kb) {
    const auto red = static_cast<std::int32_t>(std::lround(kr * one));
    const auto blue = static_cast<std::int32_t>(std::lround(kb * one));
    return {red, one - red - blue, blue};
  }
};

/// One colour of a picture: a plane, or a place among interleaved samples.
struct ColourView {
  const void* data = nullptr;  ///< the first pixel of the plane
  std::ptrdiff_t stride = 0;   ///< bytes from one row to the next
  int place = 0;               ///< of the sample in its pixel
};

/// A picture whose colours are samples of 8 or 16 bits, read in place.
struct RgbView {
  int samples = 1;  ///< per pixel in memory: 3 or 4 interleaved, 1 where each colour has a plane
  ColourView red;
  ColourView green;
  ColourView blue;
};

/// A picture of which a pixel is a 16-bit word, read in place: 5 bits of red and blue, and 5 or 6
/// of green in between.
struct RgbWordsView {
  const void* data = nullptr;
  std::ptrdiff_t stride = 0;  ///< bytes from one row to the next
  int green_bits = 6;
  bool is_blue_first = false;  ///< blue has the upper bits
};

/// Luma of a picture of the size of `out`: (weights * colours + one / 2) / one, rounded down. Words
/// are taken as 8-bit colours whose missing bits repeat the upper ones.
void luma_of_rgb(const RgbView& picture, const LumaWeights& weights, ThreadPool& threads,
                 Image<std::uint8_t>& out);
void luma_of_rgb(const RgbView& picture, const LumaWeights& weights, ThreadPool& threads,
                 Image<std::uint16_t>& out);
void luma_of_rgb(const RgbWordsView& picture, const LumaWeights& weights, ThreadPool& threads,
                 Image<std::uint8_t>& out);

}  // namespace eventcamera
