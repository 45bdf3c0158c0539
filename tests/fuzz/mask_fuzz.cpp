// SPDX-License-Identifier: LGPL-2.1-or-later
#include <cstdint>
#include <cstdio>
#include <memory>
#include <stdexcept>

#include "src/filter/pixel_mask.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  struct CloseFile {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  if (size == 0) return 0;
  const std::unique_ptr<std::FILE, CloseFile> file(
      fmemopen(const_cast<std::uint8_t*>(data), size, "rb"));
  try {
    eventcamera::PixelMask::read_png(file.get(), {8, 4});
  } catch (const std::runtime_error&) {  // no picture, or of another size
  }
  return 0;
}
