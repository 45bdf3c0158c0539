// SPDX-License-Identifier: LGPL-2.1-or-later
// Pyramids and searches equal their plain references on every SIMD target of this processor, and
// tracks are at least as accurate as OpenCV's. tests/pipelines compares them to OpenCV's on real
// video.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <opencv2/video/tracking.hpp>
#include <utility>

#include "src/flow/lucas_kanade/point_tracker.hpp"
#include "src/flow/lucas_kanade/texture.hpp"
#include "src/flow/opencv.hpp"
#include "tests/core/targets.hpp"
#include "tests/reference/lucas_kanade.hpp"
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

TEST_P(EverySize, PyramidsEqualTheReference) {
  const auto [width, height] = GetParam();
  const auto picture = scene::noise<std::uint8_t>(width, height, 8, 3);
  ThreadPool threads;
  threads.set_threads(0);
  targets::for_each([&](const char* target) {
    Pyramid pyramid;
    pyramid.build(picture.view(), threads);
    auto expected = picture;
    for (const auto& level : pyramid.levels()) {
      ASSERT_EQ(level.width(), expected.width());
      ASSERT_EQ(level.height(), expected.height());
      const reference::Mirrored mirrored{expected};
      for (int y = -16; y < expected.height() + 16; ++y) {
        for (int x = -16; x < expected.width() + 16; ++x) {
          ASSERT_EQ(level.row(y)[x], mirrored(x, y)) << target << " " << x << "," << y;
        }
      }
      expected = reference::halved(expected);
    }
  });
}

TEST_P(EverySize, GradientsEqualTheReference) {
  const int width = GetParam().width;
  const int height = GetParam().height;
  const auto picture = scene::noise<std::uint8_t>(width, height, 8, 3);
  ThreadPool threads;
  Pyramid pyramid;
  pyramid.build(picture.view(), threads);
  for (const Box& box : {Box{-7, -7, width + 8, height + 9},
                         Box{width / 3, height / 2, width / 3 + 40, height / 2 + 5}}) {
    targets::for_each([&](const char* target) {
      ScharrGradients gradients(box.width(), box.height());
      gradients.compute(pyramid.levels()[0], box);
      for (int y = box.top; y < box.bottom; ++y) {
        for (int x = box.left; x < std::min(box.right, width + ScharrGradients::margin); ++x) {
          ASSERT_EQ(gradients.x(y)[x], reference::slope(picture, x, y, true)) << target;
          ASSERT_EQ(gradients.y(y)[x], reference::slope(picture, x, y, false)) << target;
        }
      }
    });
  }
}

/// With the steepest gradients.
Image<std::uint8_t> in_black_and_white(Image<std::uint8_t> picture) {
  for (int y = 0; y < picture.height(); ++y)
    for (int x = 0; x < picture.width(); ++x) picture.at(x, y) = picture.at(x, y) < 128 ? 0 : 255;
  return picture;
}

TEST_P(EverySize, SearchesEqualTheReference) {
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
      const Tile tile{i % 2 * (width - 1) / Tile::side * Tile::side,
                      i / 2 * (height - 1) / Tile::side * Tile::side, i * 3 % 8, i * 5 % 8};
      std::vector<Search> searches;
      const int columns = std::min(Tile::side, width - tile.left);
      const int rows = std::min(Tile::side, height - tile.top);
      // Few, and all, whose windows are summed together where they move alike.
      const int count = i % 2 == 0 ? 9 : columns * rows - 2;
      searches.reserve(std::size_t{Tile::side} * Tile::side);
      for (int k = 0; k < count; ++k)
        searches.push_back({k * 7 % columns,
                            k / columns % rows,
                            {static_cast<float>(k % 5 - 2), static_cast<float>(k % 3)},
                            true});
      searches.push_back({0, 0, {1e30F, 0}, true});
      searches.push_back({0, 0, {std::nanf(""), 0}, true});
      auto expected = searches;
      for (auto& search : expected) reference::search(from, to, tile, search);
      targets::for_each([&](const char* target) {
        auto found = searches;
        gradients.compute(from_levels.levels()[0], {-7, -7, width + 9, height + 9});
        search_tile(from_levels.levels()[0], gradients, to_levels.levels()[0], tile, found);
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

TEST_P(EverySize, FindsTexture) {
  const int width = GetParam().width;
  const int height = GetParam().height;
  // Flat on the left, a straight edge at the top, texture elsewhere.
  auto picture = scene::texture<std::uint8_t>(width, height, 8, 0, 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (x < width / 2) picture.at(x, y) = 90;
      if (y < height / 3) picture.at(x, y) = y < height / 6 ? 0 : 255;
    }
  }
  ThreadPool threads;
  Pyramid pyramid;
  pyramid.build(picture.view(), threads);
  const auto& finest = pyramid.levels()[0];
  for (const bool last : {false, true}) {
    const int left = last ? (width - 1) / Tile::side * Tile::side : 0;
    const int top = last ? (height - 1) / Tile::side * Tile::side : 0;
    const Tile tile{left, top, 0, 0};
    ScharrGradients gradients(32, 32);
    gradients.compute(finest, {left - 7, top - 7, left + 24, top + 24});
    targets::for_each([&](const char* target) {
      const auto textured = textured_pixels(gradients, tile);
      for (int y = 0; y < std::min(16, height - top); ++y) {
        for (int x = 0; x < std::min(16, width - left); ++x) {
          Search search{x, y, {0, 0}, false};
          reference::search(picture, picture, tile, search);
          EXPECT_EQ(textured[static_cast<std::size_t>(y)] >> x & 1, search.found ? 1 : 0)
              << target << " " << left + x << "," << top + y;
        }
      }
    });
  }
}

TEST_P(EverySize, TracksEqualTheReference) {
  const auto [width, height] = GetParam();
  const auto from = scene::texture<std::uint8_t>(width, height, 8, 0, 0);
  const auto to = scene::texture<std::uint8_t>(width, height, 8, 3.1, -1.2);
  std::vector<Point> points;
  for (int i = 0; i < width * height; i += 1 + width * height / 50)
    points.push_back({i % width, i / width});
  ThreadPool threads;
  PointTracker tracker;
  tracker.push(from.view(), threads);
  tracker.push(to.view(), threads);
  const auto tracks = tracker.track(points, threads);
  for (std::size_t i = 0; i < points.size(); ++i) {
    SCOPED_TRACE(testing::Message() << points[i].x << "," << points[i].y);
    const auto expected = reference::track(from, to, points[i]);
    EXPECT_EQ(tracks[i].found, expected.found);
    if (!expected.found) continue;
    EXPECT_EQ(tracks[i].flow.x, expected.flow.x);
    EXPECT_EQ(tracks[i].flow.y, expected.flow.y);
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

TEST(PointTracker, IsAsTrueAsOpenCv) {
  const auto from = scene::texture<std::uint8_t>(320, 240, 8, 0, 0);
  const auto to = scene::texture<std::uint8_t>(320, 240, 8, 2.3, 1.9);
  std::vector<Point> points;
  std::vector<cv::Point2f> starts;
  for (int y = 0; y < 240; ++y) {
    for (int x = y % 3; x < 320; x += 2) {
      points.push_back({x, y});
      starts.emplace_back(static_cast<float>(x), static_cast<float>(y));
    }
  }
  ThreadPool threads;
  PointTracker tracker;
  tracker.push(from.view(), threads);
  tracker.push(to.view(), threads);
  const auto tracks = tracker.track(points, threads);
  std::vector<cv::Point2f> ends;
  std::vector<unsigned char> status;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(opencv_picture(from.view()), opencv_picture(to.view()), starts, ends,
                           status, error, {15, 15}, 3, {3, 10, 0.03});
  // Both lose some of them to repetitive texture.
  int ours = 0;
  int opencv = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto is_true = [](float x, float y) { return std::hypot(x + 2.3F, y + 1.9F) < 0.1F; };
    ours += tracks[i].found && is_true(tracks[i].flow.x, tracks[i].flow.y) ? 1 : 0;
    opencv += status[i] != 0 && is_true(ends[i].x - starts[i].x, ends[i].y - starts[i].y) ? 1 : 0;
  }
  EXPECT_GT(ours, static_cast<int>(points.size()) * 2 / 3);
  EXPECT_GE(ours, opencv - opencv / 1000);
}

TEST(PointTracker, DoesNotDependOnThreads) {
  const auto from = scene::noise<std::uint8_t>(200, 150, 8, 1);
  const auto to = scene::noise<std::uint8_t>(200, 150, 8, 2);
  std::vector<Point> points;
  for (int y = 0; y < 150; ++y)
    for (int x = 0; x < 200; ++x) points.push_back({x, y});
  const auto tracks = [&](int count) {
    ThreadPool threads;
    threads.set_threads(count);
    PointTracker tracker;
    tracker.push(from.view(), threads);
    tracker.push(to.view(), threads);
    const auto found = tracker.track(points, threads);
    return std::vector<Track>(found.begin(), found.end());
  };
  const auto one = tracks(1);
  const auto all = tracks(0);
  ASSERT_EQ(one.size(), all.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    ASSERT_EQ(one[i].found, all[i].found);
    ASSERT_EQ(one[i].flow.x, all[i].flow.x);
    ASSERT_EQ(one[i].flow.y, all[i].flow.y);
  }
}

}  // namespace
