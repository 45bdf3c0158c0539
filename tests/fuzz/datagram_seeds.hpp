// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include "tests/fuzz/seed.hpp"
#include "tests/wire/datagrams.hpp"

namespace fuzz {

/// For datagram_fuzz: streams of small datagrams in every format.
inline std::vector<Seed> datagram_seeds() {
  std::vector<Seed> seeds;
  const auto formats = datagrams::all();
  for (std::size_t i = 0; i < formats.size(); ++i) {
    for (unsigned count = 1; count < 30; count += 7) {
      Seed seed{formats[i].name + "-" + std::to_string(count), {static_cast<std::uint8_t>(i)}};
      const auto events = few_events(count, {640, 480}, count);
      for (const auto& [bytes, packed, first, last] :
           datagrams::packets_of(formats[i].settings, events)) {
        const auto size = static_cast<std::uint8_t>(bytes.size());
        const auto high = static_cast<std::uint8_t>(bytes.size() >> 8);
        seed.bytes.insert(seed.bytes.end(), {size, high, 20});
        seed.bytes.insert(seed.bytes.end(), bytes.begin(), bytes.end());
      }
      seeds.push_back(seed);
    }
  }
  return seeds;
}

}  // namespace fuzz
