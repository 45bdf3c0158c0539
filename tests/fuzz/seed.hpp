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

/// At most `count`, to keep files small.
inline std::vector<AbsoluteEvent> few_events(unsigned seed, SensorSize size, std::size_t count) {
  constexpr Microseconds max_pause = 3'600'000'000;
  recordings::Random random(seed);
  auto events = recordings::random_events(random, size, count, max_pause);
  events.resize(count);
  return events;
}

}  // namespace fuzz
