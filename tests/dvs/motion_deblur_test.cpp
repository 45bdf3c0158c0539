// SPDX-License-Identifier: LGPL-2.1-or-later
// Frames without motion blur equal their plain reference and give the events of sharp frames.
#include "src/dvs/motion_deblur.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

#include "src/core/thread_pool.hpp"
#include "src/dvs/dvs_settings.hpp"
#include "src/dvs/dvs_simulator.hpp"
#include "tests/core/targets.hpp"
#include "tests/dvs/playback.hpp"
#include "tests/reference/dvs.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

Image<Flow> flow_of(int width, int height, float length) {
  Image<Flow> flow(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      flow.at(x, y) = {length * std::sin(0.05F * static_cast<float>(x - y)),
                       length * std::cos(0.03F * static_cast<float>(x + y))};
  flow.at(width / 2, height / 2) = {std::numeric_limits<float>::quiet_NaN(), 1};
  return flow;
}

struct Case {
  int width, height;
  float length;
};

template <class Pixel>
void compare_to_reference(const Case& size, int bits) {
  const int width = size.width;
  const int height = size.height;
  const float length = size.length;
  const auto frame = scene::texture<Pixel>(width, height, bits, 3, 1);
  const auto flow = flow_of(width, height, length);
  const double white = (1 << bits) - 1;
  ThreadPool threads;
  MotionDeblur deblur(width, height);
  for (const bool at_end : {false, true}) {
    deblur.set_motion(flow.view(), 0.8, at_end, threads);
    const auto expected = reference::deblurred(
        frame, bits,
        MotionDeblur::iterations, [&](int x, int y) -> auto& { return deblur.path(x, y); });
    Image<Pixel> first;
    targets::for_each([&](const char* target) {
      SCOPED_TRACE(std::string(target) + " " + std::to_string(width) + " " +
                   std::to_string(length));
      for (const int count : {1, 3}) {
        threads.set_threads(count);
        auto sharp = frame;
        deblur.sharpen(sharp, bits, threads);
        if (first.width() == 0) first = sharp;
        for (int y = 0; y < height; ++y)
          for (int x = 0; x < width; ++x) {
            ASSERT_EQ(sharp.at(x, y), first.at(x, y)) << x << " " << y;
            ASSERT_NEAR(sharp.at(x, y), expected.at(x, y) / 255 * white, 0.5 + white / 10000)
                << x << " " << y;
          }
      }
    });
  }
}

TEST(MotionDeblur, IsItsDefinitionOnAllTargets) {
  for (const auto& size :
       {Case{1, 1, 3}, Case{3, 5, 2}, Case{17, 9, 5}, Case{61, 33, 12}, Case{40, 90, 100}})
    compare_to_reference<std::uint8_t>(size, 8);
  compare_to_reference<std::uint16_t>({50, 21, 7}, 12);
}

TEST(MotionDeblur, FollowsTheFlow) {
  constexpr int width = 64;
  constexpr int height = 20;
  // The left half of the earlier frame moves right by 16, and covers the right one.
  Image<Flow> flow(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < 32; ++x) flow.at(x, y) = {16, -4};
  ThreadPool threads;
  MotionDeblur deblur(width, height);
  const auto expect = [&](int x, float dx, float dy, float length) {
    const auto& path = deblur.path(x, 10);
    EXPECT_EQ(path.dx, dx) << x;
    EXPECT_EQ(path.dy, dy) << x;
    EXPECT_EQ(path.length, length) << x;
  };
  deblur.set_motion(flow.view(), 0.5, false, threads);
  expect(25, 1, -0.25F, 8);
  expect(33, 0, 0, 1);
  deblur.set_motion(flow.view(), 0.5, true, threads);
  expect(25, 1, -0.25F, 8);
  expect(60, 0, 0, 1);
  deblur.set_motion(flow.view(), 0.05, false, threads);
  expect(25, 0, 0, 1);  // less than a pixel
  flow.at(20, 10) = {0, -1000};
  deblur.set_motion(flow.view(), 1, false, threads);
  expect(20, 0, -1, MotionDeblur::max_length);
  // What ends at 12 started near 8.
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) flow.at(x, y) = {0, static_cast<float>(y) / 2};
  deblur.set_motion(flow.view(), 1, true, threads);
  EXPECT_EQ(deblur.path(0, 12).length, 4);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) flow.at(x, y) = {static_cast<float>(x) / 2, 0};
  deblur.set_motion(flow.view(), 1, true, threads);
  EXPECT_EQ(deblur.path(12, 0).length, 4);
}

/// A texture that moves by (length, length / 3) during an exposure, in grey levels.
Image<std::uint8_t> exposed(double left, double length) {
  constexpr int samples = 41;
  Image<double> sum(90, 60);
  for (int i = 0; i < samples; ++i) {
    const double moved = left + length * (i - samples / 2) / samples;
    const auto sharp = scene::texture<std::uint8_t>(90, 60, 8, -moved, -moved / 3);
    for (int y = 0; y < 60; ++y)
      for (int x = 0; x < 90; ++x) sum.at(x, y) += sharp.at(x, y);
  }
  Image<std::uint8_t> frame(90, 60);
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 90; ++x)
      frame.at(x, y) = static_cast<std::uint8_t>(std::lround(sum.at(x, y) / samples));
  return frame;
}

double distance(const Image<std::uint8_t>& a, const Image<std::uint8_t>& b) {
  double sum = 0;
  for (int y = 10; y < 50; ++y)
    for (int x = 10; x < 80; ++x) sum += std::abs(a.at(x, y) - b.at(x, y));
  return sum / (40 * 70);
}

/// The number of events of each pixel while the texture moves by 6 pixels an interval.
Image<std::uint8_t> counts(double blur, Nanoseconds exposure) {
  auto settings = settings_of(DvsPreset::standard);
  settings.exposure_time = exposure;
  Playback playback({90, 60, 8}, settings);
  for (int i = 0; i < 5; ++i) playback.push(exposed(6 * i, blur), 8, i * 40'000'000);
  Image<std::uint8_t> out(90, 60);
  for (const auto& event : playback.events) ++out.at(event.x, event.y);
  return out;
}

TEST(MotionDeblur, GivesTheEventsOfSharpFrames) {
  const auto sharp = counts(0, 0);
  const auto blurred = counts(5, 0);
  const double loss = distance(blurred, sharp);
  EXPECT_GT(loss, 1);
  EXPECT_LT(distance(counts(5, 33'333'333), sharp), 0.6 * loss);
  EXPECT_EQ(distance(counts(5, 1'000'000), blurred), 0);  // the blur is less than a pixel
}

TEST(MotionDeblur, IsSwitchedWhilePlaying) {
  // The number of events of each interval, which ends with this exposure time.
  const auto play = [](const std::vector<Nanoseconds>& exposures) {
    auto settings = settings_of(DvsPreset::standard);
    Playback playback({90, 60, 8}, settings);
    std::vector<double> events;
    for (std::size_t i = 0; i < exposures.size(); ++i) {
      settings.exposure_time = exposures[i];
      playback.set(settings);
      const auto before = playback.events.size();
      playback.push(exposed(6.0 * static_cast<double>(i), 5), 8,
                    static_cast<Nanoseconds>(i) * 40'000'000);
      events.push_back(static_cast<double>(playback.events.size() - before));
    }
    return events;
  };
  constexpr Nanoseconds on = 33'333'333;
  const auto blurred = play({0, 0, 0, 0, 0, 0});
  const auto sharp = play({on, on, on, on, on, on});
  EXPECT_GT(sharp[1], 1.3 * blurred[1]);  // the first frame is sharp, too
  const auto switched = play({on, on, on, 0, 0, on});
  EXPECT_EQ(switched[2], sharp[2]);
  EXPECT_NEAR(switched[4], blurred[4], 0.05 * blurred[4]);
  const auto late = play({0, 0, 0, on, on, on});
  EXPECT_NEAR(late[5], sharp[5], 0.05 * sharp[5]);
}

TEST(MotionDeblur, LeavesTheFlowOfTheFramesAsTheyAre) {
  // The texture is in a part of the frame, whose flow is found from both frames each time.
  constexpr int width = 320;
  constexpr int height = 240;
  const auto sharp = make_dvs_simulator({width, height, 8});
  const auto blurred = make_dvs_simulator({width, height, 8});
  auto settings = settings_of(DvsPreset::standard);
  blurred->set(settings);
  settings.exposure_time = 30'000'000;
  sharp->set(settings);
  for (int i = 0; i < 3; ++i) {
    Image<std::uint8_t> frame(width, height);
    const auto texture = exposed(6 * i, 5);
    for (int y = 0; y < texture.height(); ++y)
      std::copy_n(texture.row(y), texture.width(), frame.row(y + 90) + 110);
    for (auto* simulator : {sharp.get(), blurred.get()})
      simulator->push(scene::luma(frame.view(), 8), i * 40'000'000, {});
    if (i == 0) continue;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        ASSERT_EQ(sharp->flow()->row(y)[x].x, blurred->flow()->row(y)[x].x) << x << " " << y;
        ASSERT_EQ(sharp->flow()->row(y)[x].y, blurred->flow()->row(y)[x].y) << x << " " << y;
      }
  }
}

}  // namespace
