// SPDX-License-Identifier: LGPL-2.1-or-later
// Denoising equals its plain reference on every SIMD target of this processor, removes noise and
// keeps edges.
#include "src/dvs/denoise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <utility>
#include <vector>

#include "tests/core/targets.hpp"
#include "tests/reference/dvs.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

template <class Pixel>
void hold_to_the_reference(int width, int height, int bits, int limit) {
  const auto packed = scene::noise<Pixel>(width, height, bits, 7);
  // The last row ends at the end of its memory, so that a sanitizer detects reads past it.
  const int stride = width + 5;
  std::vector<Pixel> memory(static_cast<std::size_t>(stride) * (height - 1) + width);
  for (int y = 0; y < height; ++y)
    std::copy_n(packed.row(y), width, memory.data() + static_cast<std::ptrdiff_t>(stride) * y);
  const ImageView<Pixel> frame{memory.data(), static_cast<std::ptrdiff_t>(stride * sizeof(Pixel)),
                               width, height};
  const auto expected = reference::denoised(frame, limit);
  targets::for_each([&](const char* target) {
    for (const int max_threads : {1, 2}) {
      ThreadPool threads;
      threads.set_threads(max_threads);
      Image<Pixel> out(width, height);
      denoise(frame, limit, threads, out);
      for (int y = 0; y < height; ++y)
        ASSERT_EQ(std::memcmp(out.row(y), expected.row(y), width * sizeof(Pixel)), 0)
            << target << ", " << width << "x" << height << ", limit " << limit << ", row " << y;
    }
  });
}

TEST(Denoise, EqualsTheReferenceOnEveryTarget) {
  const std::pair<int, int> sizes[] = {{1, 1},  {2, 1},   {1, 7},   {3, 2},  {16, 5},
                                       {17, 3}, {33, 40}, {66, 65}, {131, 9}};
  for (const auto& [width, height] : sizes) {
    for (const int limit : {1, 6, 255})
      hold_to_the_reference<std::uint8_t>(width, height, 8, limit);
    for (const int bits : {10, 16})
      for (const int limit : {1, 24, (1 << bits) - 1})
        hold_to_the_reference<std::uint16_t>(width, height, bits, limit);
  }
}

TEST(Denoise, TakesNoiseAwayAndLeavesEdges) {
  constexpr int width = 200;
  constexpr int height = 100;
  Image<std::uint8_t> frame(width, height);
  std::minstd_rand random(3);
  std::normal_distribution<> normal(0, 2);
  const auto level = [](int x) { return x < width / 2 ? 60 : 160; };
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      frame.at(x, y) = static_cast<std::uint8_t>(std::lround(level(x) + normal(random)));
  ThreadPool threads;
  Image<std::uint8_t> out(width, height);
  denoise(frame.view(), 6, threads, out);
  double before = 0;
  double after = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      before += std::pow(frame.at(x, y) - level(x), 2);
      // Each of the three neighbours beyond the edge contributes a difference of at most 6.
      EXPECT_NEAR(out.at(x, y), level(x), 8);
      if (x != width / 2 && x != width / 2 - 1) after += std::pow(out.at(x, y) - level(x), 2);
    }
  }
  // The weights reduce the standard deviation of noise to 3/8; rounding and the limit add to it.
  EXPECT_LT(std::sqrt(after / before), 0.5);
}

}  // namespace
