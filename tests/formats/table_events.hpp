// SPDX-License-Identifier: LGPL-2.1-or-later
// Events for round trips, and ways to split bytes into pieces.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string_view>
#include <vector>

#include "src/core/sensor_size.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/encoder.hpp"

namespace table_events {

using namespace eventcamera;

using Bytes = std::vector<std::uint8_t>;

inline Bytes bytes_of(std::string_view text) {
  return {text.begin(), text.end()};
}

/// Bursts at the same time, neighbours, rows, noise, and silences of hours.
inline std::vector<AbsoluteEvent> random_events(std::size_t count, SensorSize size, unsigned seed,
                                                Microseconds first = 0) {
  std::mt19937 random(seed);
  const auto below = [&](int end) {
    return static_cast<int>(random() % static_cast<unsigned>(end));
  };
  std::vector<AbsoluteEvent> events;
  Microseconds t = first;
  while (events.size() < count) {
    const int kind = below(100);
    const int run =
        std::min<int>(1 + below(kind < 5 ? 3000 : 20), static_cast<int>(count - events.size()));
    const int x = below(size.width);
    const int y = below(size.height);
    const int mean_gap = below(3) == 0 ? 0 : 1 + below(200);
    for (int i = 0; i < run; ++i) {
      const bool row = kind % 3 == 0;
      const bool noise = kind % 3 == 1;
      events.push_back(
          AbsoluteEvent::at(noise ? below(size.width) : (x + i * (1 + kind % 2)) % size.width,
                            row ? y : (noise ? below(size.height) : (y + i) % size.height), t,
                            below(kind % 4 == 0 ? 100 : 2) == 1 ? Polarity::on : Polarity::off));
      if (mean_gap > 0) t += below(mean_gap);
    }
    if (below(2000) == 0) t += 3'600'000'000LL * (1 + below(5));
    if (below(50) == 0) t += below(100'000'000);
  }
  return events;
}

inline const std::vector<SensorSize>& sizes() {
  static const std::vector<SensorSize> sizes = {{1, 1},     {2, 3},      {128, 128},  {240, 180},
                                                {640, 480}, {1280, 720}, {2048, 2048}};
  return sizes;
}

inline Bytes encoded(Encoder& encoder, std::span<const AbsoluteEvent> events,
                     std::size_t at_once = 1000) {
  Bytes bytes;
  while (!events.empty()) {
    const auto part = events.first(std::min(at_once, events.size()));
    encoder.encode(part, bytes);
    events = events.subspan(part.size());
  }
  while (encoder.finish(bytes)) continue;
  return bytes;
}

/// Feeds `bytes` in pieces of `size`, or of random sizes if it is 0.
inline std::vector<AbsoluteEvent> decoded(EventDecoder& decoder,
                                          std::span<const std::uint8_t> bytes, std::size_t size = 0,
                                          unsigned seed = 1) {
  std::mt19937 random(seed);
  Decoded out;
  while (!bytes.empty()) {
    const auto wanted = size > 0 ? size : 1 + random() % (random() % 3 == 0 ? 100'000 : 300);
    const auto piece = bytes.first(std::min<std::size_t>(wanted, bytes.size()));
    decoder.decode(piece, out);
    bytes = bytes.subspan(piece.size());
  }
  decoder.finish(out);
  return out.events;
}

/// Expects the same output of a decoder for any split of these bytes.
template <class Make>
void expect_same_however_cut(const Make& make, std::span<const std::uint8_t> bytes) {
  auto whole = make();
  const auto events = decoded(*whole, bytes, bytes.size() + 1);
  for (const std::size_t size : {1, 2, 7, 64, 4097, 0}) {
    auto decoder = make();
    EXPECT_TRUE(decoded(*decoder, bytes, size) == events) << "pieces of " << size;
    EXPECT_EQ(decoder->corruption().places, whole->corruption().places) << "pieces of " << size;
    EXPECT_EQ(decoder->corruption().first_at, whole->corruption().first_at) << "pieces of " << size;
    EXPECT_EQ(decoder->corruption().first, whole->corruption().first) << "pieces of " << size;
    EXPECT_EQ(decoder->corruption().outside, whole->corruption().outside) << "pieces of " << size;
  }
}

}  // namespace table_events
