// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>

#include "src/formats/evt/raw.hpp"
#include "tests/fuzz/seed.hpp"

namespace fuzz {

/// For word_scanner_fuzz: words of every format, in transfers and in pieces, one of which is lost.
inline std::vector<Seed> word_scanner_seeds() {
  constexpr SensorSize sensor{320, 240};
  constexpr std::size_t max_transfer = 60;
  std::vector<Seed> seeds;
  for (std::uint8_t kind = 0; kind < 10; ++kind) {
    Seed seed{"kind-" + std::to_string(kind), {kind}};
    const auto encoder = make_evt_encoder(static_cast<EvtFormat>(kind % 5), sensor);
    recordings::Random random(kind);
    const auto words =
        recordings::encode(*encoder, recordings::random_events(random, sensor, 60, 1000));
    std::uint8_t number = 0;
    for (std::size_t at = 0; at < words.size() && seed.bytes.size() < 400; at += max_transfer) {
      const auto size = std::min(max_transfer, words.size() - at);
      if (++number == 4) continue;
      seed.bytes.insert(seed.bytes.end(), {static_cast<std::uint8_t>(size), 0, number});
      const auto first = words.begin() + static_cast<std::ptrdiff_t>(at);
      seed.bytes.insert(seed.bytes.end(), first, first + static_cast<std::ptrdiff_t>(size));
    }
    seeds.push_back(std::move(seed));
  }
  return seeds;
}

}  // namespace fuzz
