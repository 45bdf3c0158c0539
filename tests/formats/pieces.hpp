// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera::pieces {

/// Every piece has `size` bytes; 0: random sizes, many of them tiny.
inline std::vector<std::span<const std::uint8_t>> of(std::span<const std::uint8_t> bytes,
                                                     std::size_t size, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::vector<std::span<const std::uint8_t>> pieces;
  while (!bytes.empty()) {
    const std::size_t small = 1 + random() % 40;
    const std::size_t wanted = size != 0 ? size : random() % 4 == 0 ? 1 + random() % 20000 : small;
    const auto count = std::min(wanted, bytes.size());
    pieces.push_back(bytes.first(count));
    bytes = bytes.subspan(count);
  }
  return pieces;
}

/// Decodes everything, each piece in its own memory.
inline Decoded decoded(EventDecoder& decoder, std::span<const std::uint8_t> bytes,
                       std::size_t piece = std::size_t{1} << 20) {
  Decoded out;
  for (const auto part : of(bytes, piece)) {
    const std::vector<std::uint8_t> copy(part.begin(), part.end());
    decoder.decode(copy, out);
  }
  decoder.finish(out);
  return out;
}

/// Expects these events and this sensor without corruption, for any split.
template <class Reader>
void expect_events(std::span<const std::uint8_t> bytes, const std::vector<AbsoluteEvent>& events,
                   SensorSize size) {
  for (const std::size_t piece : {std::size_t{1} << 20, std::size_t{1}, std::size_t{0}}) {
    Reader reader;
    EXPECT_TRUE(decoded(reader, bytes, piece).events == events);
    EXPECT_EQ(reader.size(), size);
    EXPECT_EQ(reader.corruption().places, 0U) << reader.corruption().first;
    EXPECT_EQ(reader.corruption().outside, 0U);
  }
}

}  // namespace eventcamera::pieces
