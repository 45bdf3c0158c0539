// SPDX-License-Identifier: LGPL-2.1-or-later
// Versions 1.0 and 2.0, as the first line says.
#include <memory>

#include "src/formats/aedat/aedat2_decoder.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using eventcamera::Aedat2Version;
  constexpr std::size_t version_at = 9;
  const bool is_first = size > version_at && data[version_at] == '1';
  const auto version = is_first ? Aedat2Version::one : Aedat2Version::two;
  const auto make = [version] {
    return std::make_unique<eventcamera::Aedat2Decoder>(eventcamera::SensorSize{}, version);
  };
  return fuzz::decoder(make, data, size, 1);
}
