// SPDX-License-Identifier: LGPL-2.1-or-later
// Luma of every layout equals its plain reference on every SIMD target of this processor.
#include "src/core/luma.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <utility>
#include <vector>

#include "tests/core/targets.hpp"

namespace {

using namespace eventcamera;

const LumaWeights bt601 = LumaWeights::of(0.299, 0.114);
const LumaWeights bt2020 = LumaWeights::of(0.2627, 0.0593);

namespace reference {

/// The nearest integer to the weighted mean, upwards half-way.
int luma(const LumaWeights& weights, std::int64_t red, std::int64_t green, std::int64_t blue) {
  const std::int64_t sum = weights.red * red + weights.green * green + weights.blue * blue;
  return static_cast<int>((sum + LumaWeights::one / 2) / LumaWeights::one);
}

/// The nearest integer to `value` behind `alpha` of `white`, on `black`.
int on_black(std::int64_t value, std::int64_t alpha, std::int64_t white, std::int64_t black) {
  const std::int64_t sum = value * alpha + black * (white - alpha);
  return static_cast<int>((2 * sum + white) / (2 * white));
}

/// A colour of 5 or 6 bits in 8: black stays black, and white white.
int in_8_bits(int value, int bits) {
  return bits == 5 ? value * 8 + value / 4 : value * 4 + value / 16;
}

}  // namespace reference

constexpr std::pair<int, int> sizes[] = {{1, 1},  {2, 3},  {3, 2},   {5, 4},  {15, 3},  {16, 2},
                                         {17, 5}, {31, 7}, {33, 40}, {66, 3}, {131, 37}};

/// Random samples, extremes included, with `padding` samples past each row but the last, which ends
/// the memory, so that a sanitizer sees reads past it.
template <class Sample>
struct Rows {
  Rows(int per_row, int rows, int padding, int white, unsigned seed)
      : stride(per_row + padding),
        samples(static_cast<std::size_t>(stride) * static_cast<std::size_t>(rows - 1) +
                static_cast<std::size_t>(per_row)) {
    std::mt19937 random(seed);
    std::uniform_int_distribution<int> values(-white / 4, white + white / 4);
    for (auto& sample : samples) sample = static_cast<Sample>(std::clamp(values(random), 0, white));
  }
  int at(int x, int y) const {
    return samples[static_cast<std::size_t>(y) * static_cast<std::size_t>(stride) +
                   static_cast<std::size_t>(x)];
  }
  ColourView colour(int place) const {
    return {samples.data(), stride * static_cast<std::ptrdiff_t>(sizeof(Sample)), place};
  }

  int stride;  ///< samples
  std::vector<Sample> samples;
};

/// Compares what `convert` fills with what `expected` says of each pixel, on every target, with one
/// thread and with two.
template <class Pixel>
void expect_luma(int width, int height, const auto& convert, const auto& expected) {
  targets::for_each([&](const char* target) {
    for (const int count : {1, 2}) {
      ThreadPool threads;
      threads.set_threads(count);
      Image<Pixel> out(width, height);
      convert(threads, out);
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
          ASSERT_EQ(out.at(x, y), expected(x, y))
              << target << ", " << width << "x" << height << ", at " << x << "," << y;
    }
  });
}

template <class Sample>
void expect_interleaved(int width, int height, int padding, int white) {
  // xRGB, RGB, BGR, RGBx, BGRA
  const int layouts[][4] = {{4, 1, 2, 3}, {3, 0, 1, 2}, {3, 2, 1, 0}, {4, 0, 1, 2}, {4, 2, 1, 0}};
  for (const auto& [samples, red, green, blue] : layouts) {
    const Rows<Sample> rows(width * samples, height, padding, white, 3);
    const RgbView view{samples, rows.colour(red), rows.colour(green), rows.colour(blue)};
    const auto sample = [&, per_pixel = samples](int x, int y, int place) {
      return rows.at(x * per_pixel + place, y);
    };
    expect_luma<Sample>(
        width, height,
        [&](ThreadPool& threads, Image<Sample>& out) { luma_of_rgb(view, bt601, threads, out); },
        [&](int x, int y) {
          return reference::luma(bt601, sample(x, y, view.red.place),
                                 sample(x, y, view.green.place), sample(x, y, view.blue.place));
        });
  }
}

template <class Sample>
void expect_planes(int width, int height, int padding, int white) {
  const Rows<Sample> red(width, height, padding, white, 5);
  const Rows<Sample> green(width, height, 2 * padding, white, 6);
  const Rows<Sample> blue(width, height, 3 * padding, white, 7);
  expect_luma<Sample>(
      width, height,
      [&](ThreadPool& threads, Image<Sample>& out) {
        luma_of_rgb(RgbView{1, red.colour(0), green.colour(0), blue.colour(0)}, bt2020, threads,
                    out);
      },
      [&](int x, int y) {
        return reference::luma(bt2020, red.at(x, y), green.at(x, y), blue.at(x, y));
      });
}

TEST(Luma, OfRgbEqualsTheReferenceOnEveryTarget) {
  for (const auto& [width, height] : sizes) {
    for (const int padding : {0, 5}) {
      expect_interleaved<std::uint8_t>(width, height, padding, 255);
      expect_planes<std::uint8_t>(width, height, padding, 255);
      for (const int white : {1023, 65535}) {
        expect_interleaved<std::uint16_t>(width, height, padding, white);
        expect_planes<std::uint16_t>(width, height, padding, white);
      }
    }
  }
}

TEST(Luma, OfRgbWordsEqualsTheReferenceOnEveryTarget) {
  for (const auto& [width, height] : sizes) {
    for (const int green_bits : {5, 6}) {
      for (const bool is_blue_first : {false, true}) {
        const Rows<std::uint16_t> rows(width, height, 3, 65535, 11);
        const auto colour = [&](int x, int y, int shift, int bits) {
          return reference::in_8_bits(rows.at(x, y) >> shift & ((1 << bits) - 1), bits);
        };
        expect_luma<std::uint8_t>(
            width, height,
            [&](ThreadPool& threads, Image<std::uint8_t>& out) {
              const ColourView all = rows.colour(0);
              luma_of_rgb(RgbWordsView{all.data, all.stride, green_bits, is_blue_first}, bt601,
                          threads, out);
            },
            [&](int x, int y) {
              const int upper = colour(x, y, 5 + green_bits, 5);
              const int lower = colour(x, y, 0, 5);
              return reference::luma(bt601, is_blue_first ? lower : upper,
                                     colour(x, y, 5, green_bits), is_blue_first ? upper : lower);
            });
      }
    }
  }
}

TEST(Luma, OfGreyIsThatGrey) {
  for (const auto& weights : {bt601, bt2020, LumaWeights::of(0.2126, 0.0722)})
    EXPECT_EQ(weights.red + weights.green + weights.blue, LumaWeights::one);
}

TEST(Luma, IsGatheredFromPackedPictures) {
  for (const auto& [width, height] : sizes) {
    for (const int step : {2, 3, 4}) {
      const Rows<std::uint8_t> rows(width * step, height, 5, 255, 13);
      const ColourView all = rows.colour(0);
      expect_luma<std::uint8_t>(
          width, height,
          [&](ThreadPool&, Image<std::uint8_t>& out) {
            gather_luma(static_cast<const std::uint8_t*>(all.data), all.stride, step, out);
          },
          [&, by = step](int x, int y) { return rows.at(x * by, y); });
    }
  }
}

template <class Sample>
void expect_composited(int width, int height, int step, int bits, bool is_narrow) {
  const int white = (1 << bits) - 1;
  const int black = is_narrow ? 16 << (bits - 8) : 0;
  const Rows<Sample> luma(width, height, 3, white, 17);
  const Rows<Sample> alpha(width * step, height, 5, white, 19);
  const ColourView lumas = luma.colour(0);
  const ColourView alphas = alpha.colour(0);
  const auto expected = [&](int x, int y) {
    return reference::on_black(luma.at(x, y), alpha.at(x * step, y), white, black);
  };
  const AlphaView view{alphas.data, alphas.stride, step};
  expect_luma<Sample>(
      width, height,
      [&](ThreadPool& threads, Image<Sample>& out) {
        composite_on_black({{width, height, bits}, lumas.data, lumas.stride, is_narrow}, view,
                           threads, out);
      },
      expected);
  expect_luma<Sample>(
      width, height,
      [&](ThreadPool& threads, Image<Sample>& out) {
        for (int y = 0; y < height; ++y)
          for (int x = 0; x < width; ++x) out.at(x, y) = static_cast<Sample>(luma.at(x, y));
        composite_on_black({{width, height, bits}, out.view().data, out.stride(), is_narrow}, view,
                           threads, out);
      },
      expected);
}

TEST(Luma, IsCompositedOnBlack) {
  for (const auto& [width, height] : sizes) {
    for (const int step : {1, 4}) {
      for (const bool is_narrow : {false, true}) {
        expect_composited<std::uint8_t>(width, height, step, 8, is_narrow);
        for (const int bits : {10, 12, 16})
          expect_composited<std::uint16_t>(width, height, step, bits, is_narrow);
      }
    }
  }
}

TEST(Luma, OfSwappedWordsIsPutInOrder) {
  const std::uint8_t bytes[] = {0x12, 0x34, 0xff, 0x00, 0xab, 0xcd};
  std::uint16_t words[3];
  std::memcpy(words, bytes, sizeof(words));
  Image<std::uint16_t> out(3, 1);
  swap_luma(words, sizeof(words), out);
  EXPECT_EQ(out.at(0, 0), 0x1234);
  EXPECT_EQ(out.at(1, 0), 0xff00);
  EXPECT_EQ(out.at(2, 0), 0xabcd);
}

}  // namespace
