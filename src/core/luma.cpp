// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/core/luma.hpp"

#define HWY_TARGET_INCLUDE "src/core/luma.cpp"
#include <hwy/foreach_target.h>
// Must come after HWY_TARGET_INCLUDE.
#include <hwy/highway.h>

#include <cassert>

#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// 32-bit sums; capped so that no vector exceeds the row padding of an Image.
using Sums = hn::CappedTag<std::uint32_t, 16>;
using SumVector = hn::Vec<Sums>;

/// Composites a vector of pixels of `bits` bits. With half of it added, x / (2^bits - 1) is
/// (x + (x >> bits)) >> bits.
SumVector on_black(int bits, std::uint32_t black, SumVector luma, SumVector alpha) {
  const Sums sums;
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
  const Sums sums;
  const hn::Rebind<Pixel, Sums> pixels;
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

HWY_EXPORT(composite_bytes);
HWY_EXPORT(composite_16_bits);

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
