// SPDX-License-Identifier: LGPL-2.1-or-later
// AEDAT 3.1: hand-made files are read, through wraps and silences and with any split; corrupt files
// lose only the corrupt parts.
#include <gtest/gtest.h>

#include "src/formats/aedat/aedat3_decoder.hpp"
#include "tests/formats/aedat_files.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using aedat_files::Bytes;
using recordings::decode;
using recordings::Events;

constexpr SensorSize davis346{346, 260};
constexpr Microseconds hour = 3'600'000'000;

Events some_events(SensorSize size, std::size_t count, Microseconds max_pause) {
  return recordings::random_events(size, count, 1, 0, max_pause);
}

TEST(Aedat3, PolarityEventsOfAllTimes) {
  for (const auto& [size, camera] : {std::pair{davis346, "DAVIS346C"}, {{2048, 2048}, "Other"}}) {
    const auto events = some_events(size, 30'000, 300 * hour);
    const auto bytes = aedat_files::aedat3(events, camera, 1000);
    EXPECT_TRUE(recordings::events_however_split([] { return std::make_unique<Aedat3Decoder>(); },
                                                 bytes) == events);
    Aedat3Decoder decoder;
    decode(decoder, bytes);
    EXPECT_EQ(decoder.size(), size == davis346 ? size : SensorSize{});
    EXPECT_EQ(decoder.corruption().places + decoder.corruption().outside, 0U);
  }
}

TEST(Aedat3, OtherPacketsAreLeftOutAndEdgesAreTriggers) {
  auto bytes = aedat_files::aedat3_header("DVS128");
  aedat_files::add_aedat3_packet_header(bytes, 3, 36, 0, 2);  // IMU
  bytes.resize(bytes.size() + 72, 1);
  aedat_files::add_aedat3_packet_header(bytes, 0, 8, 1, 6);
  for (const int type : {0, 2, 3, 4, 7, 9}) {
    aedat_files::add_little(bytes, type << 1 | 1, 4);
    aedat_files::add_little(bytes, 100 + type, 4);
  }
  aedat_files::add_aedat3_packet_header(bytes, 1, 8, 1, 2);
  aedat_files::add_little(bytes, 5 << 17 | 6 << 2 | 2, 4);  // not valid
  aedat_files::add_little(bytes, 200, 4);
  aedat_files::add_little(bytes, 5 << 17 | 6 << 2 | 3, 4);
  aedat_files::add_little(bytes, 201, 4);
  Aedat3Decoder decoder;
  const auto out = decode(decoder, bytes, 1);
  const auto base = Microseconds{1} << 31;
  EXPECT_EQ(out.events, (std::vector{AbsoluteEvent::at(5, 6, base + 201, Polarity::on)}));
  EXPECT_EQ(out.triggers, (std::vector<Trigger>{{base + 102, 0, true},
                                                {base + 103, 0, false},
                                                {base + 104, 0, true},
                                                {base + 107, 1, false},
                                                {base + 109, 2, true}}));
  EXPECT_EQ(decoder.corruption().places, 0U) << decoder.corruption().first;
}

TEST(Aedat3, WhatIsNotAedat3IsRefused) {
  for (const std::string_view text :
       {"", "#!AER-DAT2.0\r\n", "#!AER-DAT3.1\r\n", "#!AER-DAT3.1\r\nno end",
        "#!AER-DAT3.1\r\n#Format: Serial-TS\r\n#!END-HEADER\r\n"}) {
    Aedat3Decoder decoder;
    EXPECT_THROW(decode(decoder, recordings::bytes_of(text)), UnsupportedFormat) << text;
  }
}

TEST(Aedat3, ABrokenPacketCostsNoOther) {
  const auto events = some_events(davis346, 5000, 1000);
  const auto sound = aedat_files::aedat3(events, "DAVIS346", 1000);
  const auto header = aedat_files::aedat3_header("DAVIS346").size();
  constexpr std::size_t packet = 28 + 8000;
  const auto broken = [&](const char* what, std::size_t first_lost, std::size_t max_lost,
                          auto change) {
    SCOPED_TRACE(what);
    auto bytes = sound;
    change(bytes);
    for (const std::size_t piece : {SIZE_MAX, std::size_t{0}}) {
      Aedat3Decoder decoder;
      const auto found = decode(decoder, bytes, piece).events;
      ASSERT_GE(found.size() + max_lost, events.size());
      const auto before = static_cast<std::ptrdiff_t>(first_lost);
      EXPECT_TRUE(std::equal(events.begin(), events.begin() + before, found.begin()));
      EXPECT_TRUE(std::equal(events.end() - 3000, events.end(), found.end() - 3000));
      EXPECT_EQ(decoder.corruption().places, 1U) << decoder.corruption().first;
    }
  };
  broken("header", 1000, 1000, [&](Bytes& b) { b[header + packet + 5] = 3; });
  broken("number larger", 2000, 0, [&](Bytes& b) {
    for (const std::size_t field : {16, 20, 24}) b[header + packet + field + 1] = 0x0f;
  });
  broken("bytes missing", 1500, 510, [&](Bytes& b) {
    const auto at = b.begin() + static_cast<std::ptrdiff_t>(header + packet + 28 + 4000);
    b.erase(at, at + 43);
  });
  broken("events missing", 1500, 10, [&](Bytes& b) {
    const auto at = b.begin() + static_cast<std::ptrdiff_t>(header + packet + 28 + 4000);
    b.erase(at, at + 80);
  });

  auto bytes = sound;
  bytes.erase(bytes.end() - 12, bytes.end());
  Aedat3Decoder decoder;
  EXPECT_EQ(decode(decoder, bytes, 0).events.size(), 4998U);
  EXPECT_EQ(decoder.corruption().places, 1U);
}

TEST(Aedat3, EventsOutsideAreDroppedAlone) {
  for (const std::size_t max_events : {100, 30}) {
    Events events(60, AbsoluteEvent::at(1, 2, 3, Polarity::on));
    auto expected = events;
    for (const auto i : {9, 10, 11, 13, 59}) {
      events[static_cast<std::size_t>(i)] = AbsoluteEvent::at(346, 2, 3, Polarity::on);
      expected.pop_back();
    }
    const auto bytes = aedat_files::aedat3(events, "DAVIS346", max_events);
    for (const std::size_t piece : {SIZE_MAX, std::size_t{1}}) {
      Aedat3Decoder decoder;
      EXPECT_TRUE(decode(decoder, bytes, piece).events == expected);
      EXPECT_EQ(decoder.corruption().outside, 5U);
      EXPECT_EQ(decoder.corruption().places, 0U) << decoder.corruption().first;
    }
  }
}

}  // namespace
