// SPDX-License-Identifier: LGPL-2.1-or-later
// The words of EVT_FORMAT, one of EvtFormat.
#include "src/formats/evt/raw.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace eventcamera;
  return fuzz::decoder(
      [] {
        return make_evt_decoder(EvtFormat::EVT_FORMAT, {640, 480});
      },
      data, size, 6);
}
