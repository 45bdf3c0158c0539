// SPDX-License-Identifier: LGPL-2.1-or-later
// Compares the light of moving pixels to its definition.
#include "src/dvs/moving_light.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tests/core/targets.hpp"
#include "tests/reference/dvs.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

struct Case {
  int width, height;
  float max_length;
};

/// Smooth flow of up to about `max_length` pixels, with a few pixels that move elsewhere.
Image<Flow> flow_of(int width, int height, float max_length) {
  Image<Flow> flow(width, height);
  std::minstd_rand random(3);
  std::uniform_real_distribution<float> anywhere(-2 * max_length, 2 * max_length);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto u = static_cast<float>(x);
      const auto v = static_cast<float>(y);
      flow.at(x, y) = {max_length * std::sin(0.05F * u - 0.1F * v),
                       max_length * std::cos(0.07F * u)};
      if (random() % 50 == 0) flow.at(x, y) = {anywhere(random), anywhere(random)};
    }
  }
  flow.at(width / 2, height / 2) = {std::numeric_limits<float>::quiet_NaN(), 1e30F};
  return flow;
}

/// Moves rows as a whole and in two runs.
template <class Pixel, class Check>
void move_rows(const Warp<Pixel>& warp, const Image<Flow>& flow, const Check& check) {
  constexpr int middle = 16;
  const int width = flow.width();
  const std::ptrdiff_t stride = width + 8;
  std::vector<std::uint16_t> luma(static_cast<std::size_t>(stride * warp.steps));
  for (int y = 0; y < flow.height(); ++y) {
    for (const int end : {middle, width}) {
      const Run run{y, end == middle ? 0 : std::min(middle, width), std::min(end, width)};
      if (run.width() <= 0) continue;
      move_light(warp, flow.view(), run, luma.data(), stride);
      for (int j = 1; j < warp.steps; ++j)
        for (int x = run.first; x < run.last; ++x)
          check(x, y, j, luma[static_cast<std::size_t>((j - 1) * stride + x - run.first)]);
    }
  }
}

/// Compares to the definition, to within rounding in units of `scale`.
template <class Pixel>
void compare_to_definition(const Case& size, int bits, double scale, double precision) {
  const auto& [width, height, max_length] = size;
  const auto last = scene::texture<Pixel>(width, height, bits, 3, 1);
  const auto now = scene::noise<Pixel>(width, height, bits, 5);
  const auto flow = flow_of(width, height, max_length);
  for (const int steps : {2, 3, 11, 32}) {
    targets::for_each([&](const char* target) {
      SCOPED_TRACE(std::string(target) + " " + std::to_string(flow.width()) + " " +
                   std::to_string(steps));
      move_rows(Warp<Pixel>{last.view(), now.view(), steps}, flow,
                [&](int x, int y, int j, int luma) {
                  const double expected =
                      reference::moving_luma(last, now, flow.at(x, y), x, y, j, steps);
                  ASSERT_NEAR(luma, scale * expected, precision) << x << " " << y << " " << j;
                });
    });
  }
}

TEST(MovingLight, IsItsDefinitionOnAllTargets) {
  for (const Case& size : {Case{1, 1, 1}, Case{3, 5, 2}, Case{17, 9, 40}, Case{61, 33, 0.4F},
                           Case{90, 40, 6}, Case{130, 20, 30}}) {
    compare_to_definition<std::uint8_t>(size, 8, 257, 0.54);  // 1/4096 of a grey level first
  }
  compare_to_definition<std::uint16_t>({50, 20, 4}, 12, 1, 0.51);
}

TEST(MotionTiles, HaveTheirStepsOfTheReference) {
  constexpr int max_steps = 20;
  for (const Case& size :
       {Case{1, 1, 1}, Case{70, 45, 0.01F}, Case{131, 45, 7}, Case{90, 37, 40}}) {
    const auto flow = flow_of(size.width, size.height, size.max_length);
    ThreadPool threads;
    threads.set_threads(2);
    MotionTiles tiles;
    tiles.measure(flow.view(), max_steps, threads);
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x)
        ASSERT_EQ(tiles.steps(x / MotionTiles::width, y / MotionTiles::height),
                  reference::steps_of_tile(flow, x, y, max_steps));
  }
}

}  // namespace
