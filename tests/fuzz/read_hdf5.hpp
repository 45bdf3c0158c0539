// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "src/formats/byte_source.hpp"
#include "src/formats/hdf5/hdf5_reader.hpp"
#include "tests/fuzz/fuzz_decoder.hpp"

namespace fuzz {

/// Reads part of a file, seeks, and reads again.
inline void read_hdf5(std::span<const std::uint8_t> bytes) {
  try {
    Hdf5Reader reader(
        std::make_unique<MemoryBytes>(std::vector<std::uint8_t>(bytes.begin(), bytes.end())));
    // A few compressed bytes can be many events.
    constexpr std::size_t max_events = 100'000;
    std::vector<AbsoluteEvent> events;
    std::vector<Trigger> triggers;
    while (events.size() < max_events && reader.read(10'000, events) > 0) {
    }
    require(events.size() <= max_events + 10'000, "no more is read than is asked for");
    reader.read_triggers(10'000, triggers);
    if (const auto range = reader.time_range()) reader.seek(range->first / 2 + range->last / 2);
    reader.read(1, events);
    const auto [width, height] = reader.size();
    for (const auto& event : events)
      require(width == 0 || (event.x < width && event.y() < height),
              "events are within the sensor");
  } catch (const std::runtime_error&) {
    // Invalid files must be reported.
  }
}

}  // namespace fuzz
