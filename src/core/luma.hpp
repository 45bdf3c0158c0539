// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "src/core/image.hpp"
#include "src/core/thread_pool.hpp"

namespace eventcamera {

/// Frame format, constant within a stream.
struct LumaFormat {
  int width = 0;
  int height = 0;
  int bits = 8;  ///< 8: one byte per pixel; 9 to 16: one 16-bit word per pixel; white is 2^bits - 1

  friend bool operator==(const LumaFormat&, const LumaFormat&) = default;
};

/// Non-owning view of the luma of one frame.
struct LumaView {
  LumaFormat format;
  const void* data = nullptr;
  std::ptrdiff_t stride = 0;  ///< bytes from one row to the next
  bool is_narrow = false;     ///< limited range: white is 235/255 of full scale

  /// Pixel must be std::uint8_t if format.bits is 8, std::uint16_t otherwise.
  template <class Pixel>
  ImageView<Pixel> as() const {
    return {static_cast<const Pixel*>(data), stride, format.width, format.height};
  }
};

/// Copies luma that is interleaved with chroma: every `step`-th byte (2 to 4), starting at `data`.
void gather_luma(const std::uint8_t* data, std::ptrdiff_t stride, int step,
                 Image<std::uint8_t>& out);

/// Copies big-endian 16-bit luma in native byte order.
void swap_luma(const void* data, std::ptrdiff_t stride, Image<std::uint16_t>& out);

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

/// Alpha of a frame, in samples of the size of its luma.
struct AlphaView {
  const void* data = nullptr;
  std::ptrdiff_t stride = 0;  ///< bytes from one row to the next
  int step = 1;               ///< samples from one pixel to the next, 1 or 4
};

/// Composites luma on black: (luma * alpha + black * (white - alpha)) / white, rounded. `out` has
/// the size of the frame, and may be the image that `luma` views.
void composite_on_black(const LumaView& luma, const AlphaView& alpha, ThreadPool& threads,
                        Image<std::uint8_t>& out);
void composite_on_black(const LumaView& luma, const AlphaView& alpha, ThreadPool& threads,
                        Image<std::uint16_t>& out);

/// Converts frames to the 8 bits that optical flow works on: 8-bit frames are passed through,
/// deeper ones are reduced to their upper 8 bits.
class Grey8 {
 public:
  /// The view is valid until the next call, and no longer than `frame`.
  ImageView<std::uint8_t> of(const LumaView& frame) {
    if (frame.format.bits == 8) return frame.as<std::uint8_t>();
    const auto deep = frame.as<std::uint16_t>();
    if (upper_.width() != deep.width || upper_.height() != deep.height)
      upper_ = Image<std::uint8_t>(deep.width, deep.height);
    const int shift = frame.format.bits - 8;
    for (int y = 0; y < deep.height; ++y)
      for (int x = 0; x < deep.width; ++x)
        upper_.at(x, y) = static_cast<std::uint8_t>(deep.row(y)[x] >> shift);
    return upper_.view();
  }

 private:
  Image<std::uint8_t> upper_;
};

}  // namespace eventcamera
