// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/simulator/camera_profile.hpp"

#include <cstdint>
#include <stdexcept>

#include "tests/fuzz/fuzz_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    for (const auto& [name, value] : parse_camera_profile(text, "eventsim-dvs"))
      fuzz::require(!name.empty() && value.size() <= size, "entries come from the text");
  } catch (const std::runtime_error&) {  // no profile
  }
  return 0;
}
