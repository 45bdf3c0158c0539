// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/render/map_picture.hpp"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <vector>

#include "src/render/palette.hpp"

namespace eventcamera {
namespace {

/// Event count shown in full colour.
float full_scale(const Image<std::uint32_t>& map) {
  std::vector<std::uint32_t> counts;
  for (int y = 0; y < map.height(); ++y)
    std::copy_if(map.row(y), map.row(y) + map.width(), std::back_inserter(counts),
                 [](std::uint32_t count) { return count > 0; });
  if (counts.empty()) return 1;
  const auto top = counts.begin() + static_cast<std::ptrdiff_t>((counts.size() - 1) * 199 / 200);
  std::ranges::nth_element(counts, top);
  return static_cast<float>(*top);
}

/// Draws a map at column `left`; value(x, y) is in [-1, 1].
template <class Value>
void draw(RgbPicture& picture, int left, const Image<std::uint32_t>& map, PaletteName palette,
          const Value& value) {
  const auto& colours = shades(palette);
  for (int y = 0; y < map.height(); ++y) {
    auto* out = picture.row(y) + std::ptrdiff_t{3} * left;
    for (int x = 0; x < map.width(); ++x) {
      const auto& colour = colours[shade(value(x, y))];
      *out++ = colour.red;
      *out++ = colour.green;
      *out++ = colour.blue;
    }
  }
}

void draw_counts(RgbPicture& picture, int left, const Image<std::uint32_t>& map, float scale) {
  draw(picture, left, map, PaletteName::magma,
       [&](int x, int y) { return static_cast<float>(map.at(x, y)) / scale; });
}

}  // namespace

RgbPicture draw_map(const Image<std::uint32_t>& map) {
  RgbPicture picture(map.width(), map.height());
  draw_counts(picture, 0, map, full_scale(map));
  return picture;
}

RgbPicture draw_maps(const Image<std::uint32_t>& reference, const Image<std::uint32_t>& candidate) {
  RgbPicture picture(3 * reference.width(), reference.height());
  const float scale = std::max(full_scale(reference), full_scale(candidate));
  draw_counts(picture, 0, reference, scale);
  draw_counts(picture, reference.width(), candidate, scale);
  draw(picture, 2 * reference.width(), reference, PaletteName::red_blue, [&](int x, int y) {
    return (static_cast<float>(candidate.at(x, y)) - static_cast<float>(reference.at(x, y))) /
           scale;
  });
  return picture;
}

}  // namespace eventcamera
