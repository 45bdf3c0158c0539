// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/render/overlay.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace eventcamera {
namespace {

/// Pixels that a sensor pixel covers along one axis of the frame: [first, second), at least one.
std::pair<int, int> covered(int at, int sensor, int picture) {
  const auto place = [sensor, picture](int x) {
    return static_cast<int>(std::int64_t{x} * picture / sensor);
  };
  const int first = place(at);
  return {first, std::max(first + 1, place(at + 1))};
}

}  // namespace

Overlay::Overlay(SensorSize sensor, SensorSize picture)
    : sensor_(sensor),
      picture_(picture),
      validator_(sensor.width, sensor.height),
      window_(sensor.width, sensor.height, {}),
      kinds_(picture.width, picture.height) {}

InvalidEvents Overlay::add(std::span<const Event> events, Microseconds start, Microseconds max_t) {
  return validator_.for_each_valid(events, start, max_t,
                                   [this](const AbsoluteEvent& event) { window_.add(event); });
}

void Overlay::mark(int x, int y, std::uint8_t kind) {
  const auto [left, right] = covered(x, sensor_.width, picture_.width);
  const auto [top, bottom] = covered(y, sensor_.height, picture_.height);
  for (int row = top; row < bottom; ++row)
    for (int column = left; column < right; ++column) kinds_.at(column, row) |= kind;
}

void Overlay::draw(Microseconds start, Microseconds end, const Palette& palette, double opacity,
                   const PixelLayout& layout, std::byte* picture, std::ptrdiff_t stride) {
  window_.begin_at(std::exchange(has_drawn_, true) ? start + 1 : start);
  validator_.pass(end + 1);
  for (int y = 0; y < sensor_.height; ++y) {
    const auto* row = window_.row(y);
    for (int x = 0; x < sensor_.width; ++x)
      if (const auto kind = kind_of(row[x]); kind != 0) mark(x, y, kind);
  }

  const auto pixels = pixels_by_kind(palette, layout);
  const int weight = static_cast<int>(std::lround(256 * opacity));
  const auto bytes = static_cast<std::size_t>(layout.bytes);
  for (int y = 0; y < picture_.height; ++y) {
    auto* out = reinterpret_cast<std::uint8_t*>(picture + y * stride);
    auto* kinds = kinds_.row(y);
    for (int x = 0; x < picture_.width; ++x, out += bytes) {
      if (kinds[x] == 0) continue;
      const auto& colour = pixels[std::exchange(kinds[x], 0)];
      for (std::size_t i = 0; i < bytes; ++i)
        out[i] = static_cast<std::uint8_t>(out[i] + (colour[i] - out[i]) * weight / 256);
    }
  }
}

}  // namespace eventcamera
