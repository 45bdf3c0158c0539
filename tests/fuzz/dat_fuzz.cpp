// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/dat/dat.hpp"

#include "tests/fuzz/fuzz_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::decoder(eventcamera::make_dat_decoder, data, size, 1);
}
