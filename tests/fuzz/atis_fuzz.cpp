// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/atis/atis_bin.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::decoder([] { return eventcamera::make_atis_bin_decoder({34, 34}); }, data, size, 1);
}
