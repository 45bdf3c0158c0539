// SPDX-License-Identifier: LGPL-2.1-or-later
// Denoising equals its plain reference on every SIMD target of this processor.
#include "src/simulate/denoiser.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
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

}  // namespace
