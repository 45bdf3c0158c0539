// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/luma.hpp"

#include <algorithm>
#include <cassert>

#define HWY_TARGET_INCLUDE "src/core/luma.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

// 32-bit sums; capped so that no vector exceeds the row padding of an Image.
using Sums = hn::CappedTag<std::int32_t, 16>;
using SumVector = hn::Vec<Sums>;
using UnsignedSums = hn::RebindToUnsigned<Sums>;

/// Rounded weighted sums of a vector of pixels.
SumVector luma_of(const LumaWeights& weights, SumVector red, SumVector green, SumVector blue) {
  const Sums sums;
  const auto reds = red * hn::Set(sums, weights.red);
  const auto greens = green * hn::Set(sums, weights.green);
  const auto blues = blue * hn::Set(sums, weights.blue);
  const auto half = hn::Set(sums, LumaWeights::one / 2);
  return hn::ShiftRight<LumaWeights::bits>(reds + greens + (blues + half));
}

/// Computes the luma of `count` pixels with separate colours. Writes up to a vector past the end.
template <class Pixel>
void weigh(const LumaWeights& weights, const Pixel* red, const Pixel* green, const Pixel* blue,
           int count, Pixel* out) {
  const Sums sums;
  const hn::Rebind<Pixel, Sums> pixels;
  const int lanes = static_cast<int>(hn::Lanes(sums));
  const auto step = [&](int x, const auto& load) {
    const auto luma =
        luma_of(weights, hn::PromoteTo(sums, load(red + x)), hn::PromoteTo(sums, load(green + x)),
                hn::PromoteTo(sums, load(blue + x)));
    hn::StoreU(hn::DemoteTo(pixels, luma), pixels, out + x);
  };
  int x = 0;
  for (; x + lanes <= count; x += lanes)
    step(x, [&](const Pixel* from) { return hn::LoadU(pixels, from); });
  if (x < count) step(x, [&](const Pixel* from) { return load_first(pixels, from, count - x); });
}

template <class Pixel>
const Pixel* row_of(const ColourView& colour, int y) {
  return reinterpret_cast<const Pixel*>(static_cast<const std::byte*>(colour.data) +
                                        y * colour.stride);
}

/// Computes a row with interleaved colours, which are separated block by block.
template <class Pixel>
void weigh_interleaved(const LumaWeights& weights, const RgbView& frame, int y, int width,
                       Pixel* out) {
  const hn::CappedTag<Pixel, 32> block;
  constexpr int max = static_cast<int>(hn::MaxLanes(block));
  const int lanes = static_cast<int>(hn::Lanes(block));
  HWY_ALIGN Pixel apart[4][max];
  HWY_ALIGN Pixel last[4 * max] = {};
  const Pixel* row = row_of<Pixel>(frame.red, y);
  for (int x = 0; x < width; x += lanes) {
    const int count = std::min(lanes, width - x);
    const Pixel* from = row + std::ptrdiff_t{x} * frame.samples;
    if (count < lanes) {
      std::copy_n(from, count * frame.samples, last);
      from = last;
    }
    auto first = hn::Zero(block);
    auto second = first;
    auto third = first;
    auto fourth = first;
    if (frame.samples == 3)
      hn::LoadInterleaved3(block, from, first, second, third);
    else
      hn::LoadInterleaved4(block, from, first, second, third, fourth);
    hn::Store(first, block, apart[0]);
    hn::Store(second, block, apart[1]);
    hn::Store(third, block, apart[2]);
    hn::Store(fourth, block, apart[3]);
    weigh(weights, apart[frame.red.place], apart[frame.green.place], apart[frame.blue.place], count,
          out + x);
  }
}

template <class Pixel>
void luma_of_samples(const RgbView& frame, const LumaWeights& weights, ThreadPool& threads,
                     Image<Pixel>& out) {
  for_each_row(threads, out.height(), [&](int y) {
    if (frame.samples == 1)
      weigh(weights, row_of<Pixel>(frame.red, y), row_of<Pixel>(frame.green, y),
            row_of<Pixel>(frame.blue, y), out.width(), out.row(y));
    else
      weigh_interleaved(weights, frame, y, out.width(), out.row(y));
  });
}

constexpr auto& luma_of_bytes = luma_of_samples<std::uint8_t>;
constexpr auto& luma_of_16_bits = luma_of_samples<std::uint16_t>;

void luma_of_words(const RgbWordsView& frame, const LumaWeights& weights, ThreadPool& threads,
                   Image<std::uint8_t>& out) {
  const Sums sums;
  const hn::Rebind<std::uint16_t, Sums> words;
  const hn::Rebind<std::uint8_t, Sums> pixels;
  const int lanes = static_cast<int>(hn::Lanes(sums));
  const LumaWeights in_order =
      frame.is_blue_first ? LumaWeights{weights.blue, weights.green, weights.red} : weights;
  // Expands the colour of `bits` bits at `shift` to 8 bits.
  const auto colour = [&](SumVector word, int shift, int bits) {
    const auto value =
        hn::And(hn::ShiftRightSame(word, shift), hn::Set(sums, (std::int32_t{1} << bits) - 1));
    return hn::Or(hn::ShiftLeftSame(value, 8 - bits), hn::ShiftRightSame(value, 2 * bits - 8));
  };
  const auto step = [&](const auto loaded, std::uint8_t* to) {
    const auto word = hn::PromoteTo(sums, loaded);
    const auto luma = luma_of(in_order, colour(word, 5 + frame.green_bits, 5),
                              colour(word, 5, frame.green_bits), colour(word, 0, 5));
    hn::StoreU(hn::DemoteTo(pixels, luma), pixels, to);
  };
  for_each_row(threads, out.height(), [&](int y) {
    const auto* row = row_of<std::uint16_t>({frame.data, frame.stride}, y);
    int x = 0;
    for (; x + lanes <= out.width(); x += lanes) step(hn::LoadU(words, row + x), out.row(y) + x);
    if (x < out.width()) step(load_first(words, row + x, out.width() - x), out.row(y) + x);
  });
}

/// Composites a vector of pixels of `bits` bits. With half of it added, x / (2^bits - 1) is
/// (x + (x >> bits)) >> bits.
hn::Vec<UnsignedSums> on_black(int bits, std::uint32_t black, hn::Vec<UnsignedSums> luma,
                               hn::Vec<UnsignedSums> alpha) {
  const UnsignedSums sums;
  const auto white = hn::Set(sums, (1U << bits) - 1);
  const auto opacity = hn::Min(alpha, white);
  const auto behind = hn::Set(sums, black) * (white - opacity);
  const auto half = hn::Set(sums, 1U << (bits - 1));
  const auto sum = luma * opacity + behind + half;
  return hn::ShiftRightSame(sum + hn::ShiftRightSame(sum, bits), bits);
}

/// Loads every `step`-th sample; reads all samples of the last pixel.
template <int step, class Pixels, class Pixel>
hn::Vec<Pixels> load_alpha(Pixels pixels, const Pixel* from) {
  if constexpr (step == 1) {
    return hn::LoadU(pixels, from);
  } else {
    hn::Vec<Pixels> alpha;
    hn::Vec<Pixels> others[3];
    hn::LoadInterleaved4(pixels, from, alpha, others[0], others[1], others[2]);
    return alpha;
  }
}

template <int step, class Pixel>
void composite(const LumaView& luma, const AlphaView& alpha, ThreadPool& threads,
               Image<Pixel>& out) {
  const UnsignedSums sums;
  const hn::Rebind<Pixel, UnsignedSums> pixels;
  const int lanes = static_cast<int>(hn::Lanes(sums));
  const int bits = luma.format.bits;
  const std::uint32_t black = luma.is_narrow ? 16U << (bits - 8) : 0;
  const auto store = [&](auto lumas, auto alphas, Pixel* to) {
    const auto result =
        on_black(bits, black, hn::PromoteTo(sums, lumas), hn::PromoteTo(sums, alphas));
    hn::StoreU(hn::TruncateTo(pixels, result), pixels, to);
  };
  for_each_row(threads, out.height(), [&](int y) {
    const Pixel* lumas = luma.as<Pixel>().row(y);
    const auto* alphas = reinterpret_cast<const Pixel*>(static_cast<const std::byte*>(alpha.data) +
                                                        y * alpha.stride);
    int x = 0;
    for (; x + lanes < out.width(); x += lanes)
      store(hn::LoadU(pixels, lumas + x),
            load_alpha<step>(pixels, alphas + std::ptrdiff_t{step} * x), out.row(y) + x);
    HWY_ALIGN Pixel last[hn::MaxLanes(pixels)] = {};
    for (int i = x; i < out.width(); ++i) last[i - x] = alphas[std::ptrdiff_t{step} * i];
    store(load_first(pixels, lumas + x, out.width() - x), hn::Load(pixels, last), out.row(y) + x);
  });
}

template <class Pixel>
void composite_any(const LumaView& luma, const AlphaView& alpha, ThreadPool& threads,
                   Image<Pixel>& out) {
  assert(alpha.step == 1 || alpha.step == 4);
  if (alpha.step == 1)
    composite<1>(luma, alpha, threads, out);
  else
    composite<4>(luma, alpha, threads, out);
}

constexpr auto& composite_bytes = composite_any<std::uint8_t>;
constexpr auto& composite_16_bits = composite_any<std::uint16_t>;

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(luma_of_bytes);
HWY_EXPORT(luma_of_16_bits);
HWY_EXPORT(luma_of_words);
HWY_EXPORT(composite_bytes);
HWY_EXPORT(composite_16_bits);

void luma_of_rgb(const RgbView& frame, const LumaWeights& weights, ThreadPool& threads,
                 Image<std::uint8_t>& out) {
  HWY_DYNAMIC_DISPATCH(luma_of_bytes)(frame, weights, threads, out);
}

void luma_of_rgb(const RgbView& frame, const LumaWeights& weights, ThreadPool& threads,
                 Image<std::uint16_t>& out) {
  HWY_DYNAMIC_DISPATCH(luma_of_16_bits)(frame, weights, threads, out);
}

void luma_of_rgb(const RgbWordsView& frame, const LumaWeights& weights, ThreadPool& threads,
                 Image<std::uint8_t>& out) {
  HWY_DYNAMIC_DISPATCH(luma_of_words)(frame, weights, threads, out);
}

void composite_on_black(const LumaView& luma, const AlphaView& alpha, ThreadPool& threads,
                        Image<std::uint8_t>& out) {
  HWY_DYNAMIC_DISPATCH(composite_bytes)(luma, alpha, threads, out);
}

void composite_on_black(const LumaView& luma, const AlphaView& alpha, ThreadPool& threads,
                        Image<std::uint16_t>& out) {
  HWY_DYNAMIC_DISPATCH(composite_16_bits)(luma, alpha, threads, out);
}

namespace {

/// The step is a template argument, so that compilers vectorize the loop.
template <int step>
void gather(const std::uint8_t* data, std::ptrdiff_t stride, Image<std::uint8_t>& out) {
  for (int y = 0; y < out.height(); ++y) {
    const std::uint8_t* in = data + y * stride;
    std::uint8_t* row = out.row(y);
    for (int x = 0; x < out.width(); ++x) row[x] = in[std::ptrdiff_t{step} * x];
  }
}

}  // namespace

void gather_luma(const std::uint8_t* data, std::ptrdiff_t stride, int step,
                 Image<std::uint8_t>& out) {
  assert(step >= 2 && step <= 4);
  if (step == 2)
    gather<2>(data, stride, out);
  else if (step == 3)
    gather<3>(data, stride, out);
  else
    gather<4>(data, stride, out);
}

void swap_luma(const void* data, std::ptrdiff_t stride, Image<std::uint16_t>& out) {
  const ImageView<std::uint16_t> in{static_cast<const std::uint16_t*>(data), stride, out.width(),
                                    out.height()};
  for (int y = 0; y < out.height(); ++y) {
    const std::uint16_t* words = in.row(y);
    std::uint16_t* row = out.row(y);
    for (int x = 0; x < out.width(); ++x)
      row[x] = static_cast<std::uint16_t>(words[x] << 8 | words[x] >> 8);
  }
}

}  // namespace eventcamera
#endif  // HWY_ONCE
