// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/simulate/difference.hpp"

#include <cstdlib>
#include <limits>
#include <utility>

#define HWY_TARGET_INCLUDE "src/simulate/difference.cpp"
#include <hwy/foreach_target.h>
// Compiled once per SIMD target.
#include "src/core/simd-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace eventcamera::HWY_NAMESPACE {
namespace {

template <class Pixel>
using Pixels = hn::CappedTag<Pixel, 64>;

/// A threshold in all lanes, clamped to the largest pixel value, which no difference exceeds.
template <class Pixel>
auto in_lanes(Pixels<Pixel> pixels, int threshold) {
  return hn::Set(pixels, static_cast<Pixel>(std::min(
                             threshold, static_cast<int>(std::numeric_limits<Pixel>::max()))));
}

template <class Pixel>
void fire_row(const Pixel* before, const Pixel* now, int width, int y, const Thresholds& thresholds,
              FiredPixels& out) {
  const Pixels<Pixel> pixels;
  const int lanes = static_cast<int>(hn::Lanes(pixels));
  const auto positive = in_lanes<Pixel>(pixels, thresholds.positive);
  const auto negative = in_lanes<Pixel>(pixels, thresholds.negative);
  const auto zero = hn::Zero(pixels);
  const auto fire = [&](int x, auto a, auto b) {
    // Excess over the threshold.
    const auto rise = hn::SaturatedSub(hn::SaturatedSub(b, a), positive);
    const auto fall = hn::SaturatedSub(hn::SaturatedSub(a, b), negative);
    const auto fired = hn::Or(rise, fall) != zero;
    if (hn::AllFalse(pixels, fired)) return;
    out.add(x, y, bits_of(pixels, fired), bits_of(pixels, rise != zero));
  };
  // Most of a frame does not change: several vectors are skipped at once.
  constexpr int at_once = 4;
  const auto smaller = hn::Min(positive, negative);
  const auto none = [&](int x) {
    auto largest = zero;
    for (int i = 0; i < at_once; ++i) {
      const auto a = hn::LoadU(pixels, before + x + std::ptrdiff_t{i} * lanes);
      const auto b = hn::LoadU(pixels, now + x + std::ptrdiff_t{i} * lanes);
      largest = hn::Max(largest, hn::Or(hn::SaturatedSub(a, b), hn::SaturatedSub(b, a)));
    }
    return hn::AllTrue(pixels, hn::SaturatedSub(largest, smaller) == zero);
  };
  int x = 0;
  while (x + lanes <= width) {
    const int end = x + at_once * lanes;
    if (end <= width && none(x)) {
      x = end;
      continue;
    }
    for (; x + lanes <= std::min(end, width); x += lanes)
      fire(x, hn::LoadU(pixels, before + x), hn::LoadU(pixels, now + x));
  }
  if (x < width)
    fire(x, load_first(pixels, before + x, width - x), load_first(pixels, now + x, width - x));
}

constexpr auto& fire_row_8 = fire_row<std::uint8_t>;
constexpr auto& fire_row_16 = fire_row<std::uint16_t>;

template <class Strength>
void fire_words(Strength* strengths, std::uint8_t* touched, int words, int y, FiredPixels& out) {
  const Pixels<Strength> pixels;
  const int lanes = static_cast<int>(hn::Lanes(pixels));
  const auto zero = hn::Zero(pixels);
  const auto one = hn::Set(pixels, Strength{1});
  for (int word = 0; word < words; ++word) {
    if (std::exchange(touched[word], std::uint8_t{0}) == 0) continue;
    Strength* const first = strengths + std::ptrdiff_t{64} * word;
    std::uint64_t fired = 0;
    std::uint64_t on = 0;
    for (int i = 0; i < 64; i += lanes) {
      const auto strength = hn::LoadU(pixels, first + i);
      fired |= bits_of(pixels, strength != zero) << i;
      on |= bits_of(pixels, hn::And(strength, one) != zero) << i;
      hn::StoreU(zero, pixels, first + i);
    }
    out.add(64 * word, y, fired, on);
  }
}

constexpr auto& fire_words_16 = fire_words<std::uint16_t>;
constexpr auto& fire_words_32 = fire_words<std::uint32_t>;

template <class Pixel>
ChangedColumns changed(const Pixel* before, const Pixel* now, int width, int threshold) {
  const Pixels<Pixel> pixels;
  const int lanes = static_cast<int>(hn::Lanes(pixels));
  const auto limit = in_lanes<Pixel>(pixels, threshold);
  const auto none = [&](int x) {
    const auto a = hn::LoadU(pixels, before + x);
    const auto b = hn::LoadU(pixels, now + x);
    const auto difference = hn::Or(hn::SaturatedSub(a, b), hn::SaturatedSub(b, a));
    return hn::AllTrue(pixels, hn::SaturatedSub(difference, limit) == hn::Zero(pixels));
  };
  const auto one = [&](int x) { return std::abs(now[x] - before[x]) > threshold; };
  int first = 0;
  while (first + lanes <= width && none(first)) first += lanes;
  while (first < width && !one(first)) ++first;
  int last = width;
  while (last - lanes >= first && none(last - lanes)) last -= lanes;
  while (last > first && !one(last - 1)) --last;
  return {first, last};
}

constexpr auto& changed_8 = changed<std::uint8_t>;
constexpr auto& changed_16 = changed<std::uint16_t>;

}  // namespace
}  // namespace eventcamera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eventcamera {

HWY_EXPORT(fire_row_8);
HWY_EXPORT(fire_row_16);
HWY_EXPORT(fire_words_16);
HWY_EXPORT(fire_words_32);
HWY_EXPORT(changed_8);
HWY_EXPORT(changed_16);

void fire_differences(const std::uint8_t* before, const std::uint8_t* now, int width, int y,
                      const Thresholds& thresholds, FiredPixels& out) {
  HWY_DYNAMIC_DISPATCH(fire_row_8)(before, now, width, y, thresholds, out);
}

void fire_differences(const std::uint16_t* before, const std::uint16_t* now, int width, int y,
                      const Thresholds& thresholds, FiredPixels& out) {
  HWY_DYNAMIC_DISPATCH(fire_row_16)(before, now, width, y, thresholds, out);
}

void fire_strengths(std::uint16_t* strengths, std::uint8_t* touched, int words, int y,
                    FiredPixels& out) {
  HWY_DYNAMIC_DISPATCH(fire_words_16)(strengths, touched, words, y, out);
}

void fire_strengths(std::uint32_t* strengths, std::uint8_t* touched, int words, int y,
                    FiredPixels& out) {
  HWY_DYNAMIC_DISPATCH(fire_words_32)(strengths, touched, words, y, out);
}

ChangedColumns changed_columns(const std::uint8_t* before, const std::uint8_t* now, int width,
                               int threshold) {
  return HWY_DYNAMIC_DISPATCH(changed_8)(before, now, width, threshold);
}

ChangedColumns changed_columns(const std::uint16_t* before, const std::uint16_t* now, int width,
                               int threshold) {
  return HWY_DYNAMIC_DISPATCH(changed_16)(before, now, width, threshold);
}

}  // namespace eventcamera
#endif  // HWY_ONCE
