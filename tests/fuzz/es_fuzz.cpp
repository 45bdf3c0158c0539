// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/es/es.hpp"

#include "tests/fuzz/fuzz_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::decoder([] { return eventcamera::make_event_stream_decoder(); }, data, size, 1);
}
