// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/render/thumbnail.hpp"

#include <algorithm>

#include "src/render/palette.hpp"

namespace eventcamera {
namespace {

/// Share of pixels that suffices to recognise a scene by the outlines of moving objects.
constexpr double enough_pixels = 0.08;

/// Side of a picture of the sensor whose longer side is scaled down to `max_size`.
int scaled(int side, SensorSize sensor, int max_size) {
  const int longer = std::max(sensor.width, sensor.height);
  if (longer <= max_size) return side;
  return std::max(1, static_cast<int>((std::int64_t{side} * max_size + longer / 2) / longer));
}

}  // namespace

Thumbnail::Thumbnail(SensorSize sensor, int max_size)
    : sensor_(sensor),
      kinds_(scaled(sensor.width, sensor, max_size), scaled(sensor.height, sensor, max_size)),
      enough_(static_cast<std::size_t>(enough_pixels * kinds_.width() * kinds_.height()) + 1) {}

void Thumbnail::add(std::span<const Event> events, Microseconds start) {
  for (const auto& event : events) {
    if (event.x >= sensor_.width || event.y() >= sensor_.height) continue;
    const Microseconds time = start + event.t;
    // Simulated events of a whole frame may have the same time.
    if (is_full() && time > last_) return;
    auto& kind = kinds_.at(event.x * kinds_.width() / sensor_.width,
                           event.y() * kinds_.height() / sensor_.height);
    if (fired_ == 0) first_ = time;
    if (kind == 0) ++fired_;
    kind = event.polarity() == Polarity::on ? 2 : 1;
    last_ = time;
  }
}

bool Thumbnail::is_better_than(const Thumbnail& other) const {
  if (is_full() && other.is_full()) return last_ - first_ < other.last_ - other.first_;
  return fired_ > other.fired_;
}

RgbPicture Thumbnail::draw() const {
  const auto colours = pixels_by_kind(palette(PaletteName::dark), {.bytes = 3});
  RgbPicture picture(kinds_.width(), kinds_.height());
  for (int y = 0; y < picture.height(); ++y) {
    auto* out = picture.row(y);
    for (int x = 0; x < picture.width(); ++x)
      out = std::copy_n(colours[kinds_.at(x, y)].begin(), 3, out);
  }
  return picture;
}

}  // namespace eventcamera
