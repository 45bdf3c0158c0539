// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/formats/recordings.hpp"

namespace fuzz {

using namespace eventcamera;

/// Seed file for a fuzzer.
struct Seed {
  std::string name;
  std::vector<std::uint8_t> bytes;
};

inline recordings::Events few_events(unsigned seed, SensorSize size, std::size_t count) {
  return recordings::random_events(size, count, seed, 0, 3'600'000'000);
}

}  // namespace fuzz
