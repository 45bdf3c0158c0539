// SPDX-License-Identifier: LGPL-2.1-or-later
// Denoising equals its plain reference on every SIMD target of this processor; the estimate of the
// frame camera's noise, and what a simulator makes of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <utility>
#include <vector>

#include "src/simulate/denoiser.hpp"
#include "src/simulate/simulators.hpp"
#include "tests/core/targets.hpp"
#include "tests/reference/dvs.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

constexpr int width = 160;
constexpr int height = 120;

/// Frames of a texture that moves, but for a still part, with noise of `sigma` grey levels.
template <class Pixel = std::uint8_t>
class Scene {
 public:
  explicit Scene(double sigma, int bits = 8) : sigma_(sigma), bits_(bits) {}

  LumaView frame(int moved, int still_rows = height / 3, double offset = 0) {
    std::normal_distribution<double> noise(0, 1);
    const double scale = ((1 << bits_) - 1) / 255.0;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const int at = y < still_rows ? x : x + moved;
        const double grey = 120 + 60 * std::sin(at * 0.7) + offset + sigma_ * noise(random_);
        image_.at(x, y) = static_cast<Pixel>(std::lround(std::clamp(grey, 0.0, 255.0) * scale));
      }
    return {{width, height, bits_}, image_.row(0), image_.stride()};
  }

 private:
  double sigma_;
  int bits_;
  std::mt19937 random_{1};
  Image<Pixel> image_{width, height};
};

template <class Pixel>
double level_of_still_part(double sigma, int bits) {
  Scene<Pixel> scene(sigma, bits);
  NoiseLevel level;
  for (int i = 0; i < 6; ++i) level.update(scene.frame(3 * i));
  return level.sigma();
}

TEST(NoiseLevel, IsThatOfTheStillPart) {
  EXPECT_EQ(level_of_still_part<std::uint8_t>(0, 8), 0);
  for (const double sigma : {1.0, 2.0, 4.0, 8.0})
    EXPECT_NEAR(level_of_still_part<std::uint8_t>(sigma, 8), sigma, 0.1 + 0.1 * sigma);
  EXPECT_NEAR(level_of_still_part<std::uint16_t>(4, 12), 4, 0.5);
}

TEST(NoiseLevel, IgnoresRepeatedFramesAndChangesOfLight) {
  Scene scene(4);
  NoiseLevel level;
  for (int i = 0; i < 8; ++i) {
    const auto frame = scene.frame(0, height, i % 2 * 20);
    for (int repetition = 0; repetition < 3; ++repetition) level.update(frame);
  }
  EXPECT_NEAR(level.sigma(), 4, 0.5);
}

TEST(NoiseLevel, IgnoresBlackAndTinyFrames) {
  NoiseLevel level;
  Scene scene(2);
  for (int i = 0; i < 6; ++i) level.update(scene.frame(0, height, -300));
  EXPECT_EQ(level.sigma(), 0);
  Image<std::uint8_t> tiny(7, 3);
  for (int i = 0; i < 3; ++i) {
    tiny.at(2, 1) = static_cast<std::uint8_t>(i * 50);
    level.update({{7, 3, 8}, tiny.row(0), tiny.stride()});
  }
  EXPECT_EQ(level.sigma(), 0);
}

TEST(NoiseLevel, FollowsChanges) {
  NoiseLevel level;
  Scene loud(8);
  for (int i = 0; i < 8; ++i) level.update(loud.frame(0));
  Scene quiet(1);
  for (int i = 0; i < 5; ++i) level.update(quiet.frame(0));
  EXPECT_NEAR(level.sigma(), 1, 0.2);
}

/// Events of `frames` frames of a still scene.
std::size_t events_of(double sigma, double denoise, int frames = 6) {
  Scene scene(sigma);
  const auto simulator = make_frame_simulator({width, height, 8});
  std::size_t count = 0;
  for (int i = 0; i < frames; ++i)
    if (const auto* events = simulator->push(
            scene.frame(0, height), (i + 1) * 40'000'000,
            {.positive_threshold = 10, .negative_threshold = 10, .denoise = denoise}))
      count += events->size();
  return count;
}

TEST(Denoiser, QuietensAStillSceneFromTheFirstIntervalOn) {
  for (const int frames : {2, 6}) {
    const auto noisy = events_of(4, 0, frames);
    EXPECT_GT(noisy, 500U * (frames - 1));
    EXPECT_LT(events_of(4, automatic_denoise, frames), noisy / 5);
  }
}

template <class Pixel>
void hold_to_the_reference(int columns, int rows, int bits, int limit) {
  const auto packed = scene::noise<Pixel>(columns, rows, bits, 7);
  // The last row ends at the end of its memory, so that a sanitizer detects reads past it.
  const int stride = columns + 5;
  std::vector<Pixel> memory(static_cast<std::size_t>(stride) * (rows - 1) + columns);
  for (int y = 0; y < rows; ++y)
    std::copy_n(packed.row(y), columns, memory.data() + static_cast<std::ptrdiff_t>(stride) * y);
  const ImageView<Pixel> frame{memory.data(), static_cast<std::ptrdiff_t>(stride * sizeof(Pixel)),
                               columns, rows};
  const auto expected = reference::denoised(frame, limit);
  targets::for_each([&](const char* target) {
    for (const int max_threads : {1, 2}) {
      ThreadPool threads;
      threads.set_threads(max_threads);
      Image<Pixel> out(columns, rows);
      denoise(frame, limit, threads, out);
      for (int y = 0; y < rows; ++y)
        ASSERT_EQ(std::memcmp(out.row(y), expected.row(y), columns * sizeof(Pixel)), 0)
            << target << ", " << columns << "x" << rows << ", limit " << limit << ", row " << y;
    }
  });
}

TEST(Denoise, EqualsTheReferenceOnEveryTarget) {
  const std::pair<int, int> sizes[] = {{1, 1},  {2, 1},   {1, 7},   {3, 2},  {16, 5},
                                       {17, 3}, {33, 40}, {66, 65}, {131, 9}};
  for (const auto& [columns, rows] : sizes) {
    for (const int limit : {1, 6, 255})
      hold_to_the_reference<std::uint8_t>(columns, rows, 8, limit);
    for (const int bits : {10, 16})
      for (const int limit : {1, 24, (1 << bits) - 1})
        hold_to_the_reference<std::uint16_t>(columns, rows, bits, limit);
  }
}

}  // namespace
