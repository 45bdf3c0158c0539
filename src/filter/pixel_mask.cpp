// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/filter/pixel_mask.hpp"

#include <png.h>

#include <stdexcept>

namespace eventcamera {
namespace {

/// A picture read by libpng, which owns its memory.
struct PngImage : png_image {
  PngImage() : png_image{} { version = PNG_IMAGE_VERSION; }
  ~PngImage() { png_image_free(this); }
  PngImage(const PngImage&) = delete;
  PngImage& operator=(const PngImage&) = delete;
};

}  // namespace

PixelMask::PixelMask(SensorSize sensor)
    : width_(static_cast<std::size_t>(sensor.width)),
      words_((width_ * static_cast<std::size_t>(sensor.height) + 63) / 64) {}

PixelMask PixelMask::parse_png(std::string_view png, SensorSize sensor) {
  PngImage image;
  if (png_image_begin_read_from_memory(&image, png.data(), png.size()) == 0)
    throw std::runtime_error(image.message);
  const SensorSize size{static_cast<int>(image.width), static_cast<int>(image.height)};
  if (size != sensor)
    throw std::runtime_error("it has " + in_pixels(size) + ", but the sensor has " +
                             in_pixels(sensor));
  image.format = PNG_FORMAT_GRAY;
  std::vector<png_byte> pixels(PNG_IMAGE_SIZE(image));
  constexpr png_color black = {0, 0, 0};
  if (png_image_finish_read(&image, &black, pixels.data(), 0, nullptr) == 0)
    throw std::runtime_error(image.message);
  PixelMask mask(sensor);
  for (int y = 0; y < sensor.height; ++y)
    for (int x = 0; x < sensor.width; ++x)
      if (pixels[mask.index(x, y)] >= 128) mask.keep(x, y);
  return mask;
}

}  // namespace eventcamera
