// SPDX-License-Identifier: LGPL-2.1-or-later
// Lists of hot pixels.
#include "src/filter/hot_pixel_filter.hpp"

#include <stdexcept>

#include "tests/fuzz/fuzz_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace eventcamera;
  try {
    const auto pixels = parse_pixel_list({reinterpret_cast<const char*>(data), size});
    fuzz::require(parse_pixel_list(pixel_list_text(pixels)) == pixels,
                  "a list is read as it was written");
  } catch (const std::invalid_argument&) {
  }
  return 0;
}
