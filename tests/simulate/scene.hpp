// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <tuple>
#include <vector>

#include "src/simulate/simulator.hpp"

/// Synthetic images, and the events that a simulator generates from them.
namespace scene {

using eventcamera::Event;
using eventcamera::Image;
using eventcamera::ImageView;
using eventcamera::LumaView;
using eventcamera::Nanoseconds;
using eventcamera::Settings;
using eventcamera::Simulator;

inline constexpr Nanoseconds frame_time = 40'000'000;

template <class Pixel>
Image<Pixel> flat(int width, int height, int grey) {
  Image<Pixel> picture(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) picture.at(x, y) = static_cast<Pixel>(grey);
  return picture;
}

/// Random pixels in the full range of `bits`.
template <class Pixel>
Image<Pixel> noise(int width, int height, int bits, unsigned seed) {
  std::minstd_rand random(seed);
  Image<Pixel> picture(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      picture.at(x, y) = static_cast<Pixel>(random() >> 8 & ((1U << bits) - 1));
  return picture;
}

/// A section of an infinite smooth texture with full contrast, as seen by a camera at (left, top).
template <class Pixel>
Image<Pixel> texture(int width, int height, int bits, double left, double top) {
  const double white = (1 << bits) - 1;
  Image<Pixel> picture(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double u = x + left;
      const double v = y + top;
      const double wave = std::sin(u * 0.31 + std::sin(v * 0.13)) * std::cos(v * 0.23) +
                          0.6 * std::sin(u * 0.11 - v * 0.17) + 0.3 * std::cos(u * 0.57 + v * 0.4);
      picture.at(x, y) = static_cast<Pixel>(white * (0.5 + wave / 3.9));
    }
  }
  return picture;
}

/// A square with its upper left corner at (left, top) on a flat background.
inline Image<std::uint8_t> square(int width, int height, int left, int top, int side,
                                  std::uint8_t grey, std::uint8_t ground) {
  auto picture = flat<std::uint8_t>(width, height, ground);
  for (int y = std::max(0, top); y < std::min(height, top + side); ++y)
    for (int x = std::max(0, left); x < std::min(width, left + side); ++x) picture.at(x, y) = grey;
  return picture;
}

template <class Pixel>
LumaView luma(const ImageView<Pixel>& picture, int bits) {
  return {{picture.width, picture.height, bits}, picture.data, picture.stride};
}

inline LumaView luma(const Image<std::uint8_t>& picture) {
  return luma(picture.view(), 8);
}

inline std::vector<Event> copy(const eventcamera::EventBuckets& buckets) {
  std::vector<Event> events(buckets.size());
  eventcamera::ThreadPool threads;
  buckets.write_to(events.data(), threads);
  return events;
}

/// Pushes frames `frame_time` apart and returns the events of the last interval.
inline std::vector<Event> last_interval(Simulator& simulator, const Settings& settings,
                                        const std::vector<LumaView>& frames) {
  simulator.reset();
  std::vector<Event> events;
  Nanoseconds time = 1'000'000;
  for (const auto& frame : frames) {
    if (const auto* made = simulator.push(frame, time, settings)) events = copy(*made);
    time += frame_time;
  }
  return events;
}

/// True if events are sorted by time, then in raster order, with each pixel at most once per time.
inline bool sorted(const std::vector<Event>& events) {
  for (std::size_t i = 1; i < events.size(); ++i) {
    const auto& a = events[i - 1];
    const auto& b = events[i];
    if (std::tuple(a.t, a.y(), a.x) >= std::tuple(b.t, b.y(), b.x)) return false;
  }
  return true;
}

}  // namespace scene
