// SPDX-License-Identifier: LGPL-2.1-or-later
#include <memory>

#include "src/formats/aedat/aedat2_decoder.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::decoder([] { return std::make_unique<eventcamera::Aedat2Decoder>(); }, data, size,
                       1);
}
