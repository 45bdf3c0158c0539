// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/numpy/npz.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace eventcamera;
  try {
    MemoryBytes bytes({data, data + size});
    const auto reader = make_npz_decoder();
    reader->open(bytes);
    // A few compressed bytes can be many events.
    constexpr std::size_t max_events = 1'000'000;
    std::size_t count = 0;
    while (count < max_events) {
      const auto item = reader->next();
      if (!item) break;
      const auto events = std::get<EventItem>(*item).events;
      fuzz::require(!events.empty() && events.size() <= 65'536, "events come in pieces");
      count += events.size();
    }
    const auto& corruption = reader->corruption();
    fuzz::require((corruption.places == 0) == corruption.first.empty(),
                  "corruption says what it is");
  } catch (const UnsupportedFormat& error) {
    fuzz::require(error.what()[0] != 0, "an error says why");
  }
  return 0;
}
