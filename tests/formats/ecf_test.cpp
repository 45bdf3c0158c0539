// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/hdf5/ecf.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "tests/formats/recordings.hpp"

namespace {

using namespace recordings;

Bytes encoded_chunk(const Events& events) {
  Bytes chunk;
  encode_ecf(events, chunk);
  EXPECT_LE(chunk.size(), ecf_max_bytes(events.size()));
  return chunk;
}

void expect_comes_back(const Events& events) {
  Events out = {AbsoluteEvent::at(1, 2, 3, Polarity::on)};
  const auto before = out.front();
  ASSERT_TRUE(decode_ecf(encoded_chunk(events), out));
  EXPECT_EQ(out.front(), before);
  out.erase(out.begin());
  EXPECT_TRUE(out == events) << events.size();
}

TEST(Ecf, ChunkByteByByte) {
  // Two events of one row, then one 1000 us later in another: runs of y, masks of x, runs of p.
  const Events events = {AbsoluteEvent::at(5, 9, 100, Polarity::on),
                         AbsoluteEvent::at(7, 9, 100, Polarity::on),
                         AbsoluteEvent::at(3, 9, 1100, Polarity::off)};
  const Bytes expected = {3 << 2,
                          0,
                          0,
                          0,  // three events, nothing packed,
                          100,
                          0,
                          0,
                          0,
                          0,
                          0,
                          0,
                          0,     // from 100 us on
                          0x02,  // no later, two events
                          0xf8,
                          0xfe,
                          0xf3,
                          0x01,  // 0x3e8 us later, one event
                          (9 << 5 & 0xff) | 3,
                          9 >> 3,  // three in row 9
                          (5 << 5 & 0xff) | 8,
                          0,  // x = 5 and 5 + 2,
                          3 << 5,
                          0,  // x = 3
                          0x82,
                          0x01};  // two ON, one OFF
  EXPECT_EQ(encoded_chunk(events), expected);
  expect_comes_back(events);
}

TEST(Ecf, PackedChunksByteByByte) {
  // Rows that differ: v = y << 12 | x << 1 | p of four events in three words.
  Events events = {AbsoluteEvent::at(0x123, 0x456, 0, Polarity::on),
                   AbsoluteEvent::at(0x321, 0x654, 0, Polarity::off),
                   AbsoluteEvent::at(0x7ff, 0x7fe, 0, Polarity::on),
                   AbsoluteEvent::at(0, 1, 0, Polarity::off)};
  auto chunk = encoded_chunk(events);
  ASSERT_EQ(chunk.size(), 12U + 1 + 12);
  EXPECT_EQ(chunk[0], 4 << 2 | 2);
  const std::uint32_t v[] = {0x456247, 0x654642, 0x7fefff, 0x1000};
  std::uint32_t words[3];
  std::memcpy(words, chunk.data() + 13, sizeof words);
  EXPECT_EQ(words[0], v[0] << 8 | (v[1] & 0xff));
  EXPECT_EQ(words[1], (v[1] >> 8) << 16 | (v[2] & 0xffff));
  EXPECT_EQ(words[2], (v[2] >> 16) << 24 | v[3]);
  expect_comes_back(events);

  // One row with x that fall: v = x << 1 | p.
  for (auto& event : events) event.y_p = static_cast<std::uint16_t>((event.y_p & 0x8000) | 5);
  events[1].x = 0x100;
  events[2].x = 0x0ff;
  chunk = encoded_chunk(events);
  ASSERT_EQ(chunk.size(), 12U + 1 + 2 + 6);
  EXPECT_EQ(chunk[0], 4 << 2 | 1);
  const unsigned u[] = {0x247, 0x200, 0x1ff, 0};
  std::uint16_t halves[3];
  std::memcpy(halves, chunk.data() + 15, sizeof halves);
  EXPECT_EQ(halves[0], u[0] << 4 | (u[1] & 0xf));
  EXPECT_EQ(halves[1], ((u[1] >> 4) << 8 | (u[2] & 0xff)) & 0xffff);
  EXPECT_EQ(halves[2], ((u[2] >> 8) << 12 | u[3]) & 0xffff);
  expect_comes_back(events);
}

TEST(Ecf, ComesBack) {
  for (const SensorSize size : {SensorSize{1, 1}, {2, 3}, {640, 480}, {2048, 2048}})
    for (unsigned seed = 0; seed < 60; ++seed)
      expect_comes_back(random_events(size, seed < 40 ? seed : seed * seed * 10, seed));
  expect_comes_back(random_events({2048, 2048}, ecf_max_events, 1, -5'000'000'000));
  // Runs at and around the lengths at which the encoding changes.
  for (const std::size_t count : {14, 15, 16, 30, 31, 32, 126, 127, 128, 65534, 65535})
    expect_comes_back(Events(count, AbsoluteEvent::at(2047, 2047, 1LL << 62, Polarity::on)));
}

TEST(Ecf, OtherWritersGoOnBehindTheLastEvent) {
  auto chunk = encoded_chunk({AbsoluteEvent::at(5, 9, 100, Polarity::on),
                              AbsoluteEvent::at(7, 9, 100, Polarity::on),
                              AbsoluteEvent::at(3, 9, 1100, Polarity::off)});
  chunk[21] |= 31;  // the last mask
  Events out;
  ASSERT_TRUE(decode_ecf(chunk, out));
  EXPECT_EQ(out.size(), 3U);
  EXPECT_EQ(out[2].x, 3);
}

TEST(Ecf, CorruptChunksAreRefused) {
  const auto events = random_events({640, 480}, 500, 3);
  const auto chunk = encoded_chunk(events);
  Events out;
  for (std::size_t size = 0; size < chunk.size(); ++size) {
    EXPECT_FALSE(decode_ecf(std::span(chunk).first(size), out)) << size;
    EXPECT_TRUE(out.empty());
  }
  // More events than a chunk can have, a run longer than the chunk, a time of more than 64 bits.
  EXPECT_FALSE(decode_ecf(Bytes{0, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3}, out));
  Bytes run = {4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2};
  run.resize(100);
  EXPECT_FALSE(decode_ecf(run, out));
  Bytes endless = {4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  endless.resize(100, 0xff);
  EXPECT_FALSE(decode_ecf(endless, out));
}

}  // namespace
