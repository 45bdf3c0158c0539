// SPDX-License-Identifier: LGPL-2.1-or-later
// AEDAT 3.1: hand-made files are read, through wraps and silences and with any split; corrupt files
// lose only the corrupt parts.
#include <gtest/gtest.h>

#include "src/formats/aedat/aedat3_decoder.hpp"
#include "tests/formats/aedat_files.hpp"
#include "tests/formats/pieces.hpp"
#include "tests/formats/random_events.hpp"

namespace {

using namespace eventcamera;
using aedat_files::Bytes;
using pieces::decoded;

constexpr SensorSize davis346{346, 260};
constexpr Microseconds hour = 3'600'000'000;

TEST(Aedat3, PolarityEventsOfAllTimes) {
  const auto events = random_events::make(davis346, 30'000, 1, 0, {300 * hour});
  const auto bytes = aedat_files::aedat3(events, "DAVIS346C", 1000);
  pieces::expect_events<Aedat3Decoder>(bytes, events, davis346);
}

TEST(Aedat3, AnUnknownCameraHasNoSize) {
  const auto events = random_events::make({2048, 2048}, 1000, 1, 0, {hour});
  Aedat3Decoder decoder;
  EXPECT_TRUE(decoded(decoder, aedat_files::aedat3(events, "Other", 100)).events == events);
  EXPECT_EQ(decoder.size(), SensorSize{});
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
  const auto out = decoded(decoder, bytes, 1);
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
    const Bytes bytes(text.begin(), text.end());
    Aedat3Decoder decoder;
    EXPECT_THROW(decoded(decoder, bytes), UnsupportedFormat) << text;
  }
}

TEST(Aedat3, ABrokenPacketCostsNoOther) {
  const auto events = random_events::make(davis346, 5000, 1, 0, {1000});
  const auto sound = aedat_files::aedat3(events, "DAVIS346", 1000);
  const auto header = aedat_files::aedat3_header("DAVIS346").size();
  constexpr std::size_t packet = 28 + 8000;
  const auto broken = [&](const char* what, std::size_t first_lost, std::size_t max_lost,
                          auto change) {
    SCOPED_TRACE(what);
    auto bytes = sound;
    change(bytes);
    for (const std::size_t piece : {std::size_t{1} << 20, std::size_t{0}}) {
      Aedat3Decoder decoder;
      const auto found = decoded(decoder, bytes, piece).events;
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
  EXPECT_EQ(decoded(decoder, bytes, 0).events.size(), 4998U);
  EXPECT_EQ(decoder.corruption().places, 1U);
}

TEST(Aedat3, AnEventOutsideIsDropped) {
  std::vector<AbsoluteEvent> events(20, AbsoluteEvent::at(1, 2, 3, Polarity::on));
  events[10] = AbsoluteEvent::at(346, 2, 3, Polarity::on);
  Aedat3Decoder decoder;
  EXPECT_EQ(decoded(decoder, aedat_files::aedat3(events, "DAVIS346", 100)).events.size(), 19U);
  EXPECT_EQ(decoder.corruption().outside, 1U);
  EXPECT_EQ(decoder.corruption().places, 0U);
}

TEST(Aedat3, EventsOutsideAreDroppedAlone) {
  for (const std::size_t max_events : {100, 30}) {
    std::vector<AbsoluteEvent> events(60, AbsoluteEvent::at(1, 2, 3, Polarity::on));
    auto expected = events;
    for (const auto i : {9, 10, 11, 13, 59}) {
      events[static_cast<std::size_t>(i)] = AbsoluteEvent::at(346, 2, 3, Polarity::on);
      expected.pop_back();
    }
    const auto bytes = aedat_files::aedat3(events, "DAVIS346", max_events);
    for (const std::size_t piece : {std::size_t{1} << 20, std::size_t{1}}) {
      Aedat3Decoder decoder;
      EXPECT_TRUE(decoded(decoder, bytes, piece).events == expected);
      EXPECT_EQ(decoder.corruption().outside, 5U);
      EXPECT_EQ(decoder.corruption().places, 0U) << decoder.corruption().first;
    }
  }
}

}  // namespace
