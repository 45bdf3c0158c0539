// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/render/rgb_picture.hpp"

#include <png.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include "src/render/palette.hpp"

namespace eventcamera {

std::string RgbPicture::png() const {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width_);
  image.height = static_cast<png_uint_32>(height_);
  image.format = PNG_FORMAT_RGB;
  std::string bytes(PNG_IMAGE_PNG_SIZE_MAX(image), '\0');
  png_alloc_size_t size = bytes.size();
  if (png_image_write_to_memory(&image, bytes.data(), &size, 0, pixels_.data(), 0, nullptr) == 0)
    throw std::runtime_error(image.message);
  bytes.resize(size);
  return bytes;
}

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

/// Rows of the bar below a map; the first is black.
constexpr int bar_height = 8;

/// Writes a number in digits of 3x5 pixels.
void write(RgbPicture& picture, int left, int top, const std::string& number, std::uint8_t grey) {
  // An octal digit is a row, from the top.
  constexpr std::array glyphs = {075557, 026227, 071747, 071717, 055711,
                                 074717, 074757, 071111, 075757, 075717};
  for (std::size_t i = 0; i < number.size(); ++i, left += 4)
    for (int pixel = 0; pixel < 15; ++pixel)
      if ((glyphs[static_cast<std::size_t>(number[i] - '0')] >> (14 - pixel) & 1) != 0)
        std::fill_n(picture.row(top + pixel / 3) + std::ptrdiff_t{3} * (left + pixel % 3), 3, grey);
}

/// Draws a map at column `left`, and below it the colours from `low`, -1 or 0, to 1, which is a
/// count of `scale`; value(x, y) is in [-1, 1].
template <class Value>
void draw(RgbPicture& picture, int left, const Image<std::uint32_t>& map, PaletteName palette,
          float low, float scale, const Value& value) {
  const auto& colours = shades(palette);
  const int bar = map.height() + 1;
  for (int y = 0; y < picture.height(); ++y) {
    if (y == map.height()) continue;
    auto* out = picture.row(y) + std::ptrdiff_t{3} * left;
    for (int x = 0; x < map.width(); ++x) {
      const auto share = static_cast<float>(x) / static_cast<float>(map.width());
      const auto& colour = colours[shade(y < bar ? value(x, y) : low + share * (1 - low))];
      *out++ = colour.red;
      *out++ = colour.green;
      *out++ = colour.blue;
    }
  }
  const auto number = std::to_string(static_cast<int>(scale));
  const int right = left + map.width();
  const auto room = 4 * static_cast<int>(number.size());
  if (2 * room > map.width()) return;
  write(picture, left + 1, bar + 1, low < 0 ? number : "0", 255);
  write(picture, right - room, bar + 1, number, low < 0 ? 255 : 0);
}

void draw_counts(RgbPicture& picture, int left, const Image<std::uint32_t>& map, float scale) {
  draw(picture, left, map, PaletteName::magma, 0, scale,
       [&](int x, int y) { return static_cast<float>(map.at(x, y)) / scale; });
}

}  // namespace

RgbPicture draw_map(const Image<std::uint32_t>& map) {
  RgbPicture picture(map.width(), map.height() + bar_height);
  draw_counts(picture, 0, map, full_scale(map));
  return picture;
}

RgbPicture draw_maps(const Image<std::uint32_t>& reference, const Image<std::uint32_t>& candidate) {
  RgbPicture picture(3 * reference.width(), reference.height() + bar_height);
  const float scale = std::max(full_scale(reference), full_scale(candidate));
  draw_counts(picture, 0, reference, scale);
  draw_counts(picture, reference.width(), candidate, scale);
  draw(picture, 2 * reference.width(), reference, PaletteName::red_blue, -1, scale,
       [&](int x, int y) {
         return (static_cast<float>(candidate.at(x, y)) - static_cast<float>(reference.at(x, y))) /
                scale;
       });
  return picture;
}

}  // namespace eventcamera
