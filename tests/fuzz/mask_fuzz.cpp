// SPDX-License-Identifier: LGPL-2.1-or-later
#include <cstdint>
#include <stdexcept>

#include "src/filter/pixel_mask.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    eventcamera::PixelMask::parse_png({reinterpret_cast<const char*>(data), size}, {8, 4});
  } catch (const std::runtime_error&) {  // no picture, or of another size
  }
  return 0;
}
