// SPDX-License-Identifier: LGPL-2.1-or-later
// Reconstruction: compared with its equations on every SIMD target, and with a known scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "src/reconstruct/reconstruction.hpp"
#include "tests/core/targets.hpp"

namespace {

using namespace eventcamera;

/// Brightness of each pixel, in raster order.
using Picture = std::vector<double>;

std::vector<AbsoluteEvent> events_by_chance(int width, int height, int count) {
  std::minstd_rand random(7);
  const auto below = [&random](int n) { return std::uniform_int_distribution<>(0, n - 1)(random); };
  std::vector<AbsoluteEvent> events;
  for (int t = 0; t < count; ++t)
    events.push_back(AbsoluteEvent::at(below(width), below(height), t,
                                       below(3) == 0 ? Polarity::off : Polarity::on));
  return events;
}

Picture reconstruct(int width, int height, const Reconstruction::Settings& settings,
                    const std::vector<AbsoluteEvent>& events) {
  Reconstruction reconstruction(width, height, settings);
  for (const auto& event : events) reconstruction.add(event);
  reconstruction.finish_picture();
  Picture picture;
  for (int y = 0; y < height; ++y)
    reconstruction.read_row(y, [&](int, float value) { picture.push_back(value); });
  return picture;
}

/// The equations of docs/reconstruction.md.
Picture by_definition(int width, int height, const Reconstruction::Settings& settings,
                      const std::vector<AbsoluteEvent>& events) {
  const double omega = 2 * std::numbers::pi / settings.cutoff;
  const double alpha = (1 - std::sin(omega)) / std::cos(omega);
  const double phi = 2 - std::cos(omega);
  const double beta = phi - std::sqrt(phi * phi - 1);
  const auto index = [width](int x, int y) { return static_cast<std::size_t>(y * width + x); };
  Picture levels(static_cast<std::size_t>(width * height));
  Picture means(levels.size());
  const auto level = [&](int x, int y) {
    return x >= 0 && x < width && y >= 0 && y < height ? levels[index(x, y)] : 0;
  };
  for (const auto& event : events) {
    const int x = event.x;
    const int y = event.y();
    const double polarity = event.polarity() == Polarity::on ? 1 : -1;
    const double neighbours =
        (level(x - 1, y) + level(x + 1, y) + level(x, y - 1) + level(x, y + 1)) / 4;
    double& mean = means[index(x, y)];
    levels[index(x, y)] =
        beta * (0.8 * level(x, y) + 0.2 * neighbours) + (1 + beta) / 2 * (polarity - mean);
    mean = alpha * mean + (1 - alpha) * polarity;
  }
  const double deviation = settings.smoothing;
  const int radius = static_cast<int>(std::ceil(2.5 * deviation));
  Picture picture;
  double squares = 0;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double sum = 0;
      double weights = 0;
      for (int j = -radius; j <= radius; ++j)
        for (int i = -radius; i <= radius; ++i) {
          const double weight =
              deviation > 0 ? std::exp(-(i * i + j * j) / (2 * deviation * deviation)) : 1;
          weights += weight;
          sum += weight * level(std::clamp(x + i, 0, width - 1), std::clamp(y + j, 0, height - 1));
        }
      picture.push_back(sum / weights);
      squares += picture.back() * picture.back();
    }
  const auto lit = std::ranges::count_if(picture, [](double value) { return value != 0; });
  const double contrast =
      std::sqrt(squares / static_cast<double>(std::max(lit, std::ptrdiff_t{1})));
  for (double& value : picture) value /= contrast > 0 ? 2.5 * contrast : 1;
  return picture;
}

TEST(Reconstruction, FollowsItsEquations) {
  for (const auto& size : {std::pair{1, 1}, {3, 2}, {37, 21}, {70, 5}})
    for (const Reconstruction::Settings settings : {Reconstruction::Settings{},
                                                    {.cutoff = 5, .smoothing = 0},
                                                    {.cutoff = 1000, .smoothing = 3.3}})
      for (const int count : {0, 1, 3000}) {
        const int width = size.first;
        const int height = size.second;
        const auto events = events_by_chance(width, height, count);
        const auto expected = by_definition(width, height, settings, events);
        Picture first;
        targets::for_each([&](const char* target) {
          const auto picture = reconstruct(width, height, settings, events);
          for (std::size_t i = 0; i < picture.size(); ++i)
            ASSERT_NEAR(picture[i], expected[i], 1e-4) << target << ' ' << width << ' ' << i;
          if (first.empty()) first = picture;
          EXPECT_EQ(picture, first) << target;
        });
      }
}

/// A texture that moves to the right, and the events of an ideal camera that looks at it.
TEST(Reconstruction, ShowsAMovingTexture) {
  constexpr int width = 64;
  constexpr int height = 48;
  const auto texture = [](double x, double y) {
    return std::sin(0.5 * x) * std::cos(0.4 * y) + 0.5 * std::sin(0.23 * x + 0.31 * y);
  };
  constexpr double threshold = 0.3;
  Picture reference;
  Picture last;
  std::vector<AbsoluteEvent> events;
  for (int t = 0; t <= 4000; ++t) {
    last.clear();
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) last.push_back(texture(x - 0.02 * t, y));
    if (t == 0) reference = last;
    for (std::size_t i = 0; i < last.size(); ++i) {
      if (std::abs(last[i] - reference[i]) < threshold) continue;
      const bool rises = last[i] > reference[i];
      reference[i] += rises ? threshold : -threshold;
      const int pixel = static_cast<int>(i);
      events.push_back(
          AbsoluteEvent::at(pixel % width, pixel / width, t, rises ? Polarity::on : Polarity::off));
    }
  }
  const auto picture = reconstruct(width, height, {}, events);
  double product = 0;
  double squares = 0;
  double true_squares = 0;
  for (std::size_t i = 0; i < picture.size(); ++i) {
    product += picture[i] * last[i];
    squares += picture[i] * picture[i];
    true_squares += last[i] * last[i];
  }
  EXPECT_GT(product / std::sqrt(squares * true_squares), 0.9);
}

}  // namespace
