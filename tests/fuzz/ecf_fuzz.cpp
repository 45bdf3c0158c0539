// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/ecf.hpp"

#include "tests/fuzz/fuzz_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace eventcamera;
  std::vector<AbsoluteEvent> events;
  const bool sound = decode_ecf({data, size}, events);
  fuzz::require(events.size() <= ecf_max_events, "memory is bounded");
  fuzz::require(sound || events.empty(), "a corrupt chunk has no events");
  return 0;
}
