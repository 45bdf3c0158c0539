// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <opencv2/core/utility.hpp>
#include <random>
#include <thread>

#include "src/flow/dense_flow.hpp"
#include "src/flow/lucas_kanade/point_tracker.hpp"
#include "src/flow/opencv.hpp"
#include "src/flow/region_of_interest_flow.hpp"
#include "src/simulate/difference.hpp"
#include "src/simulate/moving_points.hpp"
#include "tests/core/targets.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

class EveryFlow : public testing::TestWithParam<FlowMethod> {
 protected:
  ThreadPool threads;
};

INSTANTIATE_TEST_SUITE_P(, EveryFlow,
                         testing::Values(FlowMethod::dis_lq, FlowMethod::dis_hq,
                                         FlowMethod::farneback, FlowMethod::opencv_dis));

TEST_P(EveryFlow, PointsFromTheEarlierFrameToTheLater) {
  const auto from = scene::texture<std::uint8_t>(320, 240, 8, 0, 0);
  const auto to = scene::texture<std::uint8_t>(320, 240, 8, -3, 2);  // moves right and up
  const auto finder = make_dense_flow(GetParam());
  const auto flow = finder->find(from.view(), to.view(), threads);
  double x = 0;
  double y = 0;
  for (int v = 40; v < 200; ++v) {
    for (int u = 40; u < 280; ++u) {
      x += flow.row(v)[u].x;
      y += flow.row(v)[u].y;
    }
  }
  const double error = GetParam() == FlowMethod::dis_lq ? 0.8 : 0.2;
  EXPECT_NEAR(x / (160 * 240), 3, error);
  EXPECT_NEAR(y / (160 * 240), -2, error);
}

TEST_P(EveryFlow, TakesPicturesOfAnySize) {
  for (const auto& [width, height] : {std::pair(1, 1), {1, 40}, {40, 1}, {13, 7}, {63, 65}}) {
    const auto from = scene::noise<std::uint8_t>(width, height, 8, 1);
    const auto to = scene::noise<std::uint8_t>(width, height, 8, 2);
    const auto finder = make_dense_flow(GetParam());
    const auto flow = finder->find(from.view(), to.view(), threads);
    EXPECT_EQ(flow.width, width);
    EXPECT_EQ(flow.height, height);
  }
}

TEST_P(EveryFlow, DoesNotDependOnThreads) {
  const auto from = scene::texture<std::uint8_t>(320, 240, 8, 0, 0);
  const auto to = scene::texture<std::uint8_t>(320, 240, 8, 2.3, 1.9);
  const auto one = make_dense_flow(GetParam());
  const auto many = make_dense_flow(GetParam());
  const auto a = one->find(from.view(), to.view(), threads);
  for (int count = 2; count <= cv::getNumberOfCPUs(); ++count) {
    threads.set_threads(count);
    const auto b = many->find(from.view(), to.view(), threads);
    for (int y = 0; y < 240; ++y)
      ASSERT_EQ(std::memcmp(a.row(y), b.row(y), 320 * sizeof(Flow)), 0) << count << " threads";
  }
}

TEST_P(EveryFlow, KnowsThePicturesThatWerePushedBefore) {
  const auto first = scene::texture<std::uint8_t>(200, 150, 8, 0, 0);
  const auto second = scene::texture<std::uint8_t>(200, 150, 8, 1.4, 0.8);
  const auto third = scene::texture<std::uint8_t>(200, 150, 8, 2.5, -0.6);
  const auto kept = make_dense_flow(GetParam());
  const auto fresh = make_dense_flow(GetParam());
  kept->find(first.view(), second.view(), threads);
  kept->push(third.view(), threads);
  const auto a = kept->flow(threads);
  const auto b = fresh->find(second.view(), third.view(), threads);
  for (int y = 0; y < 150; ++y)
    ASSERT_EQ(std::memcmp(a.row(y), b.row(y), 200 * sizeof(Flow)), 0) << "row " << y;
}

/// A textured square that moves by (3, 1) over a static textured background.
struct MovingPatch {
  MovingPatch() : from(picture(0, 0)), to(picture(3, 1)) {}
  static Image<std::uint8_t> picture(int dx, int dy) {
    auto result = scene::texture<std::uint8_t>(640, 480, 8, 0, 0);
    const auto patch = scene::texture<std::uint8_t>(60, 60, 8, 900, 900);
    for (int y = 0; y < 60; ++y)
      for (int x = 0; x < 60; ++x) result.at(200 + dx + x, 150 + dy + y) = patch.at(x, y);
    return result;
  }
  const Image<std::uint8_t> from;
  const Image<std::uint8_t> to;
};

TEST_P(EveryFlow, OfChangesIsNotSoughtWhereNothingChanged) {
  const MovingPatch patch;
  RegionOfInterestFlow finder(GetParam(), 640, 480);
  const auto check = [&](const Image<std::uint8_t>& from, const Image<std::uint8_t>& to, int sign) {
    const auto flow =
        finder.find(from.view(), to.view(), changed_box(from.view(), to.view(), 2), threads);
    double x = 0;
    double y = 0;
    for (int v = 0; v < 480; ++v) {
      for (int u = 0; u < 640; ++u) {
        const auto here = flow.row(v)[u];
        if (u < 100 || v < 50 || u > 363 || v > 311) {
          ASSERT_TRUE(here.x == 0 && here.y == 0);
        }
        if (u >= 215 && u < 245 && v >= 165 && v < 195) {
          x += here.x / 900;
          y += here.y / 900;
        }
      }
    }
    const double error = GetParam() == FlowMethod::dis_lq ? 0.8 : 0.2;
    EXPECT_NEAR(x, 3 * sign, error);
    EXPECT_NEAR(y, 1 * sign, error);
  };
  check(patch.from, patch.to, 1);
  check(patch.to, patch.from, -1);
  const auto still = finder.find(patch.from.view(), patch.from.view(), {}, threads);
  for (int v = 0; v < 480; ++v)
    for (int u = 0; u < 640; ++u) ASSERT_EQ(still.row(v)[u].x, 0);
}

TEST_P(EveryFlow, OfChangesIsThatOfTheWholeWhereAllChanges) {
  const auto a = scene::texture<std::uint8_t>(320, 240, 8, 0, 0);
  const auto b = scene::texture<std::uint8_t>(320, 240, 8, 2.3, 1.9);
  RegionOfInterestFlow finder(GetParam(), 320, 240);
  const Box all{0, 0, 320, 240};
  const Image<std::uint8_t>* sequence[] = {&a, &b, &b, &a, &b};
  for (int i = 1; i < 5; ++i) {
    const auto& from = *sequence[i - 1];
    const auto& to = *sequence[i];
    const auto flow = finder.find(from.view(), to.view(), i == 2 ? Box{} : all, threads);
    if (i == 2) continue;
    const auto whole = make_dense_flow(GetParam());
    const auto expected = whole->find(from.view(), to.view(), threads);
    for (int y = 0; y < 240; ++y)
      ASSERT_EQ(std::memcmp(flow.row(y), expected.row(y), 320 * sizeof(Flow)), 0) << i;
  }
}

TEST(PointTracker, FollowsATexture) {
  const auto from = scene::texture<std::uint8_t>(160, 120, 8, 0, 0);
  const auto to = scene::texture<std::uint8_t>(160, 120, 8, -4, 2);
  ThreadPool threads;
  PointTracker tracker;
  tracker.push(from.view(), threads);
  tracker.push(to.view(), threads);
  const Point points[] = {{100, 40}, {60, 50}, {80, 70}};
  for (const auto& track : tracker.track(points, threads)) {
    EXPECT_TRUE(track.found);
    EXPECT_NEAR(track.flow.x, 4, 0.1);
    EXPECT_NEAR(track.flow.y, -2, 0.1);
  }
  EXPECT_TRUE(tracker.track({}, threads).empty());
}

TEST(PointTracker, LosesWhatHasNoTexture) {
  const auto picture = scene::flat<std::uint8_t>(60, 40, 90);
  ThreadPool threads;
  PointTracker tracker;
  tracker.push(picture.view(), threads);
  tracker.push(picture.view(), threads);
  const Point points[] = {{30, 20}};
  EXPECT_FALSE(tracker.track(points, threads)[0].found);
}

TEST(FixedPoint, SharesAFlowOutOverTheSteps) {
  EXPECT_EQ(motion_per_step(8, 4), 2 << 16);
  EXPECT_EQ(motion_per_step(-1, 2), -(1 << 15));
  EXPECT_EQ(motion_per_step(std::nanf(""), 3), 0);
  EXPECT_EQ(motion_per_step(INFINITY, 1), max_side << 16);
  EXPECT_EQ(motion_per_step(-1e30F, 1), -max_side * (1 << 16));
}

TEST(FixedPoint, RoundsToTheNearestPixel) {
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
  while (each.size() < 40) {
    targets::for_each([&](const char* target) {
      for (int j = 0; j <= steps; ++j) {
        const auto indices = points.at(j, stride, memory);
        ASSERT_EQ(indices.size(), each.size());
        for (std::size_t i = 0; i < each.size(); ++i) {
          const auto [x, y] = each[i].at(j);
          EXPECT_EQ(indices[i], y * stride + x) << target;
        }
      }
    });
    const Point start{position(random), position(random)};
    const Flow flow{static_cast<float>(position(random) - start.x),
                    static_cast<float>(position(random) - start.y)};
    const auto point = moving_point(start, {flow, true}, steps, side, side);
    ASSERT_TRUE(point);
    points.push_back(*point);
    each.push_back(*point);
  }
}

TEST(OpenCvThreads, PutsBackWhatTheApplicationHadSet) {
  const int before = cv::getNumThreads();
  {
    const OpenCvThreads one(1);
    EXPECT_EQ(cv::getNumThreads(), 1);
    const OpenCvThreads one_more(1);
    EXPECT_EQ(cv::getNumThreads(), 1);
  }
  EXPECT_EQ(cv::getNumThreads(), before);
}

TEST(OpenCvThreads, LetsOnlyEqualsInTogether) {
  const int processors = cv::getNumberOfCPUs();
  std::vector<std::thread> threads;
  std::atomic<int> wrong = 0;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&, wanted = 1 + i % processors] {
      for (int k = 0; k < 50; ++k) {
        const OpenCvThreads limit(wanted);
        wrong += cv::getNumThreads() != wanted;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

TEST(OpenCvThreads, LetsNobodyWaitForEver) {
  if (cv::getNumberOfCPUs() < 2) GTEST_SKIP() << "one processor has one count only";
  std::atomic<bool> done = false;
  std::atomic<int> turns = 0;  // of the others, while the last one waits
  std::vector<std::thread> others;
  for (int i = 0; i < 4; ++i) {
    others.emplace_back([&] {
      while (!done) {
        const OpenCvThreads one(1);
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        ++turns;
      }
    });
  }
  while (turns < 8) std::this_thread::yield();
  for (int times = 0; times < 5; ++times) {
    const int before = turns;
    const OpenCvThreads two(2);
    EXPECT_LE(turns - before, 40);
  }
  done = true;
  for (auto& other : others) other.join();
}

}  // namespace
