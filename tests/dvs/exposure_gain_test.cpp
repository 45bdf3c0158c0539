// SPDX-License-Identifier: LGPL-2.1-or-later
// The gain of an exposure equals its plain reference, follows a camera's automatic exposure and not
// a lamp; eventsim-dvs then sees the scene as an event camera does.
#include "src/dvs/exposure_gain.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "src/dvs/light_response.hpp"
#include "tests/core/targets.hpp"
#include "tests/dvs/playback.hpp"
#include "tests/simulate/scene.hpp"

namespace {

using namespace eventcamera;

constexpr int width = 200;
constexpr int height = 120;

/// Gain of each of nine frames since the first: x1.47 in five intervals, then constant.
double ramp(int frame) {
  return std::pow(1.47, std::min(frame, 5) / 5.0);
}

/// A frame of a camera: light of at most 1, times the exposure, clipped, and encoded.
template <class Pixel>
Image<Pixel> exposed(const Image<double>& light, double gain, int bits, bool linear_light) {
  Image<Pixel> frame(light.width(), light.height());
  const int white = (1 << bits) - 1;
  for (int y = 0; y < light.height(); ++y)
    for (int x = 0; x < light.width(); ++x)
      frame.at(x, y) = static_cast<Pixel>(
          std::lround(white * luma_of(std::min(1.0, gain * light.at(x, y)), linear_light)));
  return frame;
}

/// A texture of light between `darkest` and `brightest`, moved by (left, top).
Image<double> scene_of(int columns, int rows, double left, double top, double darkest,
                       double brightest) {
  const auto texture = scene::texture<std::uint16_t>(columns, rows, 16, left, top);
  Image<double> light(columns, rows);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x)
      light.at(x, y) = darkest + (brightest - darkest) * texture.at(x, y) / 65535;
  return light;
}

/// Returns how many of several gains counted.
template <class Pixel>
int hold_to_the_reference(int columns, int rows, int bits, bool linear_light) {
  const auto light = [&](double moved) {
    return scene_of(columns, rows, moved, 0.3 * moved, 0.02, 1);
  };
  int counted = 0;
  for (const double true_gain : {0.7, 0.85, 0.99, 1.0, 1.03, 1.08, 1.2, 1.4}) {
    const auto last = exposed<Pixel>(light(0), 0.8, bits, linear_light);
    const auto now = exposed<Pixel>(light(1), 0.8 * true_gain, bits, linear_light);
    const double expected = reference::exposure_gain(last.view(), now.view(), bits, linear_light);
    for (const int max_threads : {1, 2}) {
      ThreadPool threads;
      threads.set_threads(max_threads);
      ExposureGain gain(bits, linear_light);
      EXPECT_NEAR(gain.between(last.view(), now.view(), threads), expected, 1e-4)
          << columns << "x" << rows << ", " << bits << " bits, gain " << true_gain;
    }
    counted += expected != 1 ? 1 : 0;
  }
  return counted;
}

TEST(ExposureGain, EqualsTheReference) {
  for (const bool linear_light : {false, true}) {
    int counted = 0;
    const std::pair<int, int> sizes[] = {{1, 1},   {3, 17},  {31, 8},   {33, 17},
                                         {65, 40}, {97, 61}, {200, 121}};
    for (const auto& [columns, rows] : sizes) {
      counted += hold_to_the_reference<std::uint8_t>(columns, rows, 8, linear_light);
      for (const int bits : {10, 16})
        counted += hold_to_the_reference<std::uint16_t>(columns, rows, bits, linear_light);
    }
    EXPECT_GT(counted, 20);
  }
}

/// Events of a video.
std::vector<TimedEvent> play(const std::vector<Image<std::uint8_t>>& frames,
                             const DvsSettings& settings) {
  Playback playback({frames[0].width(), frames[0].height(), 8}, settings);
  for (std::size_t i = 0; i < frames.size(); ++i)
    playback.push(frames[i], 8, static_cast<Nanoseconds>(i) * scene::frame_time);
  return playback.events;
}

TEST(ExposureCompensation, LeavesALampAlone) {
  // A lamp at the left edge lights a room, in which a screen on the right has its own light. It is
  // switched on between two frames.
  const auto room = [](double lamp) {
    auto light = scene_of(width, height, 0, 0, 0.1, 0.3);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width * 7 / 8; ++x)
        light.at(x, y) *= 1 + lamp / (1 + std::pow(x / 60.0, 2));
    return exposed<std::uint8_t>(light, 1, 8, false);
  };
  for (const double lamp : {0.3, 0.6, 2.0}) {
    std::vector<Image<std::uint8_t>> frames;
    frames.reserve(6);
    for (int i = 0; i < 6; ++i) frames.push_back(room(i < 3 ? 0 : lamp));
    const auto expected = play(frames, {});
    EXPECT_GT(expected.size(), 500U) << lamp;
    EXPECT_TRUE(play(frames, {.exposure_compensation = true}) == expected) << lamp;
  }
  // Brighter all over, but too suddenly for an exposure.
  std::vector<Image<std::uint8_t>> frames;
  for (const double light : {0.3, 0.3, 0.5})
    frames.push_back(
        exposed<std::uint8_t>(scene_of(width, height, 0, 0, 0.2, 0.9), light, 8, false));
  EXPECT_TRUE(play(frames, {.exposure_compensation = true}) == play(frames, {}));
}

TEST(ExposureCompensation, KeepsSaturatedPixelsAsTheyWere) {
  // A sky that is white at any exposure, and a line that becomes so.
  const auto frame = [](double gain) {
    auto light = scene_of(width, height, 0, 0, 0.1, 0.5);
    for (int x = 0; x < width; ++x) {
      for (int y = 0; y < 20; ++y) light.at(x, y) = 5;
      if (x < 20) light.at(x, 40) = 0.8;
    }
    return exposed<std::uint8_t>(light, gain, 8, false);
  };
  for (const auto upsampling : {Upsampling::linear, Upsampling::motion}) {
    std::vector<Image<std::uint8_t>> frames;
    for (const int i : {0, 1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1, 0}) frames.push_back(frame(ramp(i)));
    const DvsSettings settings{.upsampling = upsampling};
    EXPECT_GT(play(frames, settings).size(), std::size_t{width} * (height - 20));
    EXPECT_LT(play(frames, {.exposure_compensation = true, .upsampling = upsampling}).size(),
              std::size_t{width} * height / 100);
  }
}

TEST(ExposureCompensation, EqualsTheReferenceOnEveryTarget) {
  constexpr int columns = 77;
  constexpr int rows = 65;
  for (const double cutoff_frequency : {0.0, 200.0}) {
    const DvsSettings settings{.linear_light = true,
                               .exposure_compensation = true,
                               .response = Response::log,
                               .cutoff_frequency = cutoff_frequency};
    std::vector<Image<std::uint16_t>> frames;
    std::vector<reference::DvsPixel> pixels;  // in raster order
    std::vector<TimedEvent> expected;
    double gain = 1;
    for (int i = 0; i < 7; ++i) {
      const auto light = scene_of(columns, rows, 0.4 * i, 0.2 * i, 0.02, 1.4);
      frames.push_back(exposed<std::uint16_t>(light, 0.6 * ramp(i), 12, true));
      if (i > 0)
        gain *= reference::exposure_gain(frames[frames.size() - 2].view(), frames.back().view(), 12,
                                         true);
      auto pixel = pixels.begin();
      for (int y = 0; y < rows; ++y) {
        for (int x = 0; x < columns; ++x) {
          const double luma = frames.back().at(x, y) / 4095.0;
          if (i == 0)
            pixels.emplace_back(settings, pixels.size(), luma);
          else
            for (const auto& event : (pixel++)->push(luma, 2000, gain))
              expected.push_back({event.t, x, y, event.polarity});
        }
      }
    }
    EXPECT_NEAR(gain, 1.47, 0.05);
    targets::for_each([&](const char* target) {
      SCOPED_TRACE(target);
      Playback playback({columns, rows, 12}, settings);
      for (std::size_t i = 0; i < frames.size(); ++i)
        playback.push(frames[i], 12, static_cast<Nanoseconds>(i) * 2'000'000);
      expect_near(playback.events, expected, 0.01, 0.97, 5);
    });
    EXPECT_GT(expected.size(), 1000U);
  }
}

TEST(ExposureCompensation, StartsOverWithTheVideo) {
  const DvsSettings settings{.exposure_compensation = true};
  auto simulator = make_dvs_simulator({width, height, 8});
  simulator->set(settings);
  std::vector<Image<std::uint8_t>> frames;
  for (int i = 0; i < 9; ++i)
    frames.push_back(exposed<std::uint8_t>(scene_of(width, height, 1.5 * i, 0.7 * i, 0.1, 0.66),
                                           ramp(i), 8, false));
  std::vector<std::vector<Event>> rounds[2];
  for (auto& intervals : rounds) {
    simulator->reset();
    for (std::size_t i = 0; i < frames.size(); ++i)
      if (const auto* events = simulator->push(scene::luma(frames[i]),
                                               static_cast<Nanoseconds>(i) * scene::frame_time, {}))
        intervals.push_back(scene::copy(*events));
  }
  EXPECT_TRUE(rounds[0] == rounds[1]);
  // Without compensation the same picture is brighter than at first: other units, a new start.
  simulator->set({});
  const auto* events = simulator->push(scene::luma(frames.back()), 9 * scene::frame_time, {});
  ASSERT_NE(events, nullptr);
  EXPECT_EQ(events->size(), 0U);
}

}  // namespace
