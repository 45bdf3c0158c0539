// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/render/rgb_picture.hpp"

#include <png.h>

#include <cerrno>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <system_error>

namespace eventcamera {
namespace {

struct Close {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

}  // namespace

void RgbPicture::write_png(const std::string& path) const {
  std::unique_ptr<std::FILE, Close> file(std::fopen(path.c_str(), "wb"));
  if (!file) throw std::system_error(errno, std::generic_category(), path);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width_);
  image.height = static_cast<png_uint_32>(height_);
  image.format = PNG_FORMAT_RGB;
  if (png_image_write_to_stdio(&image, file.get(), 0, pixels_.data(), 0, nullptr) == 0)
    throw std::runtime_error(path + ": " + image.message);
  if (std::fclose(file.release()) != 0)
    throw std::system_error(errno, std::generic_category(), path);
}

}  // namespace eventcamera
