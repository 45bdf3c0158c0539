// SPDX-License-Identifier: LGPL-2.1-or-later
// Motion in fixed point, and points that move.
#include "src/simulate/moving_points.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/core/targets.hpp"

namespace {

using namespace eventcamera;

TEST(Motion, SharesAFlowOutOverTheSteps) {
  EXPECT_EQ(motion_per_step(8, 4), 2 << 16);
  EXPECT_EQ(motion_per_step(-1, 2), -(1 << 15));
  EXPECT_EQ(motion_per_step(std::nanf(""), 3), 0);
  EXPECT_EQ(motion_per_step(INFINITY, 1), max_side << 16);
  EXPECT_EQ(motion_per_step(-1e30F, 1), -max_side * (1 << 16));
}

TEST(Motion, RoundsToTheNearestPixel) {
  const Motion motion = motion_per_step(10, 4);  // 2.5 per step
  EXPECT_EQ(moved(100, motion, 1), 103);
  EXPECT_EQ(moved(100, motion, 2), 105);
  EXPECT_EQ(moved(100, -motion, 1), 98);
  EXPECT_EQ(moved(100, -motion, 4), 90);
}

TEST(MovingPoints, AreWhereEachOfThemIs) {
  constexpr int side = max_side;
  constexpr int steps = 7;
  constexpr int stride = side + 64;
  MovingPoints points;
  std::vector<MovingPoint> each;
  std::vector<std::int32_t> memory;
  std::mt19937 random(1);
  std::uniform_int_distribution<int> position(0, side - 1);
  const auto check = [&] {
    targets::for_each([&](const char* target) {
      for (int j = 0; j <= steps; ++j) {
        std::vector<std::int32_t> indices;
        for (std::size_t chunk = 0; chunk < points.chunks(); ++chunk) {
          const auto part = points.at(j, stride, chunk, memory);
          indices.insert(indices.end(), part.begin(), part.end());
        }
        ASSERT_EQ(indices.size(), each.size());
        for (std::size_t i = 0; i < each.size(); ++i) {
          const auto [x, y] = each[i].at(j);
          EXPECT_EQ(indices[i], y * stride + x) << target;
        }
      }
    });
  };
  while (each.size() < MovingPoints::chunk_size + 20) {
    if (each.size() < 40 || each.size() % MovingPoints::chunk_size < 2) check();
    const Point start{position(random), position(random)};
    const Flow flow{static_cast<float>(position(random) - start.x),
                    static_cast<float>(position(random) - start.y)};
    const auto point = moving_point(start, {flow, true}, steps, side, side);
    ASSERT_TRUE(point);
    points.push_back(*point);
    each.push_back(*point);
  }
  check();
}

}  // namespace
