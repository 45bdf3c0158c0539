// SPDX-License-Identifier: LGPL-2.1-or-later
// Pyramids, searches and tracks are the same on every SIMD target of this processor. How good they
// are: known_flow_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>
#include <vector>

#include "src/flow/lucas_kanade/point_tracker.hpp"
#include "tests/core/targets.hpp"
#include "tests/flow/tracks_between.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

struct Size {
  int width;
  int height;
};

class EverySize : public testing::TestWithParam<Size> {};

INSTANTIATE_TEST_SUITE_P(, EverySize,
                         testing::Values(Size{1, 1}, Size{1, 40}, Size{40, 1}, Size{2, 2},
                                         Size{16, 16}, Size{17, 33}, Size{63, 65}, Size{131, 70},
                                         Size{150, 260}));

void expect_equal(const Pyramid& pyramid, const Pyramid& expected, const char* target) {
  ASSERT_EQ(pyramid.levels().size(), expected.levels().size());
  for (std::size_t i = 0; i < pyramid.levels().size(); ++i) {
    const auto& level = pyramid.levels()[i];
    for (int y = -16; y < level.height() + 16; ++y)
      for (int x = -16; x < level.width() + 16; ++x)
        ASSERT_EQ(level.row(y)[x], expected.levels()[i].row(y)[x])
            << target << ", level " << i << ": " << x << "," << y;
  }
}

TEST_P(EverySize, PyramidsDoNotDependOnHintsOfBlackRows) {
  const int width = GetParam().width;
  const int height = GetParam().height;
  ThreadPool threads;
  threads.set_threads(0);
  targets::for_each([&](const char* target) {
    Pyramid pyramid;
    // Rows turn black, stay so, and are used again.
    for (const auto& [first, last] :
         {std::pair{0, height}, {height / 3, height / 2}, {0, 0}, {0, 0}, {height / 2, height}}) {
      auto picture = scene::noise<std::uint8_t>(width, height, 8, 3);
      std::vector<std::uint8_t> is_black(static_cast<std::size_t>(height), 0);
      for (int y = 0; y < height; ++y) {
        if (y >= first && y < last) continue;
        std::fill_n(picture.row(y), width, std::uint8_t{0});
        is_black[static_cast<std::size_t>(y)] = 1;
      }
      pyramid.build(picture.view(), threads, is_black);
      Pyramid expected;
      expected.build(picture.view(), threads);
      ASSERT_NO_FATAL_FAILURE(expect_equal(pyramid, expected, target));
    }
  });
}

/// With the steepest gradients.
Image<std::uint8_t> in_black_and_white(Image<std::uint8_t> picture) {
  for (int y = 0; y < picture.height(); ++y)
    for (int x = 0; x < picture.width(); ++x) picture.at(x, y) = picture.at(x, y) < 128 ? 0 : 255;
  return picture;
}

TEST_P(EverySize, SearchesAreTheSameOnEveryTarget) {
  const int width = GetParam().width;
  const int height = GetParam().height;
  const auto noise = [&](int seed) { return scene::noise<std::uint8_t>(width, height, 8, seed); };
  const auto texture = [&](double x, double y) {
    return scene::texture<std::uint8_t>(width, height, 8, x, y);
  };
  const std::pair<Image<std::uint8_t>, Image<std::uint8_t>> pictures[] = {
      {noise(3), noise(4)},
      {texture(0, 0), texture(-1.3, 0.8)},
      {in_black_and_white(noise(3)), in_black_and_white(noise(4))}};
  for (const auto& [from, to] : pictures) {
    ThreadPool threads;
    Pyramid from_levels;
    Pyramid to_levels;
    from_levels.build(from.view(), threads);
    ScharrGradients gradients(width + 32, height + 32);
    to_levels.build(to.view(), threads);
    for (int i = 0; i < 4; ++i) {
      // The first and the last ones, at even and odd positions.
      const Tile tile{
          std::min(i % 2 * (width - 1) / Tile::width * Tile::width + i / 2, width - 1),
          std::min(i / 2 * (height - 1) / Tile::width * Tile::width + i % 2, height - 1)};
      const int columns = std::min(Tile::side, (width - tile.left + 1) / 2);
      const int rows = std::min(Tile::side, (height - tile.top + 1) / 2);
      // A few, and all, whose windows are summed together where they move alike.
      const int step = i % 2 == 0 ? 5 : 1;
      std::vector<Search> searches;
      for (int k = 0; k < columns * rows; k += step)
        searches.push_back({k % columns,
                            k / columns,
                            {static_cast<float>(k % 5 - 2), static_cast<float>(k % 3)},
                            true});
      if (searches.size() > 9) {
        searches[4].flow = {1e30F, 0};
        searches[7].flow = {std::nanf(""), 0};
      }
      const auto search_all = [&] {
        auto found = searches;
        gradients.compute(from_levels.levels()[0], {-7, -7, width + 9, height + 9});
        search_tile(from_levels.levels()[0], gradients, to_levels.levels()[0], tile, found);
        return found;
      };
      const auto expected = search_all();
      targets::for_each([&](const char* target) {
        const auto found = search_all();
        for (std::size_t k = 0; k < found.size(); ++k) {
          SCOPED_TRACE(testing::Message() << target << ", tile " << i << ", search " << k);
          const auto bits = [](float value) { return std::bit_cast<std::uint32_t>(value); };
          EXPECT_EQ(found[k].found, expected[k].found);
          EXPECT_EQ(bits(found[k].flow.x), bits(expected[k].flow.x));
          EXPECT_EQ(bits(found[k].flow.y), bits(expected[k].flow.y));
        }
      });
    }
  }
}

TEST(PointTracker, LosesWhatHasNoTexture) {
  const auto picture = scene::flat<std::uint8_t>(60, 40, 90);
  ThreadPool threads;
  PointTracker tracker(2);
  tracker.push(picture.view(), threads);
  tracker.push(picture.view(), threads);
  const Point points[] = {{30, 20}};
  EXPECT_FALSE(tracker.track(points, threads)[0].found);
}

TEST(PointTracker, DoesNotDependOnThreads) {
  const auto from = scene::noise<std::uint8_t>(200, 150, 8, 1);
  const auto to = scene::noise<std::uint8_t>(200, 150, 8, 2);
  std::vector<Point> points;
  for (int y = 0; y < 150; ++y)
    for (int x = 0; x < 200; ++x) points.push_back({x, y});
  const auto tracks = [&](int block_side, int count) {
    return tracks_between(from, to, points, block_side, count);
  };
  for (const int block_side : {1, 2}) {
    const auto one = tracks(block_side, 1);
    const auto all = tracks(block_side, 0);
    ASSERT_EQ(one.size(), all.size());
    for (std::size_t i = 0; i < one.size(); ++i) {
      ASSERT_EQ(one[i].found, all[i].found);
      ASSERT_EQ(one[i].flow.x, all[i].flow.x);
      ASSERT_EQ(one[i].flow.y, all[i].flow.y);
    }
  }
}

}  // namespace
