// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/render/map_picture.hpp"

#include <png.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <system_error>

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
    auto* out = picture.pixels.data() +
                3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) +
                     static_cast<std::size_t>(left));
    for (int x = 0; x < map.width(); ++x) {
      const auto& colour = colours[shade(value(x, y))];
      *out++ = colour.red;
      *out++ = colour.green;
      *out++ = colour.blue;
    }
  }
}

RgbPicture blank(int width, int height) {
  return {.width = width,
          .height = height,
          .pixels = std::vector<std::uint8_t>(3 * static_cast<std::size_t>(width) *
                                              static_cast<std::size_t>(height))};
}

void draw_counts(RgbPicture& picture, int left, const Image<std::uint32_t>& map, float scale) {
  draw(picture, left, map, PaletteName::magma,
       [&](int x, int y) { return static_cast<float>(map.at(x, y)) / scale; });
}

struct Close {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

}  // namespace

void RgbPicture::write_png(const std::string& path) const {
  std::unique_ptr<std::FILE, Close> file(std::fopen(path.c_str(), "wb"));
  if (!file) throw std::system_error(errno, std::generic_category(), path);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width);
  image.height = static_cast<png_uint_32>(height);
  image.format = PNG_FORMAT_RGB;
  if (png_image_write_to_stdio(&image, file.get(), 0, pixels.data(), 0, nullptr) == 0)
    throw std::runtime_error(path + ": " + image.message);
  if (std::fclose(file.release()) != 0)
    throw std::system_error(errno, std::generic_category(), path);
}

RgbPicture draw_map(const Image<std::uint32_t>& map) {
  auto picture = blank(map.width(), map.height());
  draw_counts(picture, 0, map, full_scale(map));
  return picture;
}

RgbPicture draw_maps(const Image<std::uint32_t>& reference, const Image<std::uint32_t>& candidate) {
  auto picture = blank(3 * reference.width(), reference.height());
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
