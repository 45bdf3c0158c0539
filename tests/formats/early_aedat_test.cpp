// SPDX-License-Identifier: LGPL-2.1-or-later
// AEDAT 1 to 3: hand-made files are read, through wraps and silences and with any split; corrupt
// files lose only the corrupt parts.
#include <gtest/gtest.h>

#include "src/formats/aedat/aedat_decoder.hpp"
#include "tests/formats/aedat_files.hpp"
#include "tests/formats/recordings.hpp"
#include "tests/formats/shared_data.hpp"

namespace {

using namespace eventcamera;
using aedat_files::Bytes;
using recordings::decode;
using recordings::Events;

constexpr SensorSize davis346{346, 260};
constexpr SensorSize dvs128{128, 128};
constexpr Microseconds hour = 3'600'000'000;

Events some_events(SensorSize size) {
  return recordings::random_events(size, 30'000, 1, 5, hour);
}

/// Expects these events and this sensor without corruption, for any split.
void expect_events(const Bytes& bytes, const Events& events, SensorSize size,
                   Aedat2Version version = Aedat2Version::two) {
  EXPECT_TRUE(recordings::events_however_split(
                  [&] { return make_aedat2_decoder(SensorSize{}, version); }, bytes) == events);
  const auto decoder = make_aedat2_decoder({}, version);
  decode(*decoder, bytes);
  EXPECT_EQ(decoder->size(), size);
  EXPECT_EQ(decoder->corruption().places + decoder->corruption().outside, 0U);
}

TEST(Aedat2, ReadsTheFilesOfEveryProgram) {
  const SensorSize v2e640{640, 480};
  const auto davis = some_events(davis346);
  const auto dvs = some_events(dvs128);
  const auto v2e = some_events(v2e640);
  expect_events(
      aedat_files::aedat2_davis(davis, davis346, "eu.seebetter.ini.chips.davis.Davis346blue"),
      davis, davis346);
  expect_events(aedat_files::aedat2_dvs128(dvs), dvs, dvs128);
  expect_events(aedat_files::aedat1(dvs), dvs, dvs128, Aedat2Version::one);
  // No camera is named: the addresses tell.
  expect_events(aedat_files::aedat2_v2e(v2e, v2e640), v2e, v2e640);
  expect_events(aedat_files::aedat2_of_matlab(dvs), dvs, dvs128);
}

TEST(Aedat1, RecordsAsTheFormatHasThem) {
  Bytes bytes;
  aedat_files::add(bytes, "#!AER-DAT1.0\r\n");
  // Column 118, row 125: OFF; and an external event.
  for (const std::uint8_t byte :
       {0x02, 0x13, 0x00, 0x00, 0x01, 0x02, 0x80, 0x00, 0x00, 0x00, 0x01, 0x03})
    bytes.push_back(byte);
  const auto decoder = make_aedat2_decoder({}, Aedat2Version::one);
  const auto out = decode(*decoder, bytes);
  EXPECT_EQ(out.events, (std::vector{AbsoluteEvent::at(118, 125, 0x102, Polarity::off)}));
  EXPECT_EQ(out.triggers, (std::vector<Trigger>{{0x103, 0, true}}));
}

TEST(Aedat2, AddressesAsTheFormatHasThem) {
  auto bytes = aedat_files::aedat2_header("Davis240C");
  aedat_files::add_record(bytes, 7U << 22 | 3U << 12 | 1U << 11, 1000);
  aedat_files::add_record(bytes, 0x80000000U | 5U << 22 | 123, 1001);    // frame sample
  aedat_files::add_record(bytes, 0x80000000U | 3U << 10, 1002);          // IMU sample
  aedat_files::add_record(bytes, 1U << 10, 1003);                        // a trigger
  aedat_files::add_record(bytes, 1U << 10 | 2, 1004);                    // falling edge
  aedat_files::add_record(bytes, 9U << 22 | 4U << 12 | 1U << 10, 1005);  // v2e noise event
  const auto decoder = make_aedat2_decoder();
  const auto out = decode(*decoder, bytes);
  EXPECT_EQ(decoder->size(), (SensorSize{240, 180}));
  EXPECT_EQ(out.events, (std::vector{AbsoluteEvent::at(236, 172, 1000, Polarity::on),
                                     AbsoluteEvent::at(235, 170, 1005, Polarity::off)}));
  EXPECT_EQ(out.triggers, (std::vector<Trigger>{{1003, 0, true}, {1004, 0, false}}));

  bytes = aedat_files::aedat2_header("DVS128");
  aedat_files::add_record(bytes, 2U << 8 | 9U << 1, 50);
  aedat_files::add_record(bytes, 2U << 8 | 9U << 1 | 1, 51);
  aedat_files::add_record(bytes, 0x8000, 52);
  const auto other = make_aedat2_decoder();
  const auto of_dvs = decode(*other, bytes);
  EXPECT_EQ(of_dvs.events, (std::vector{AbsoluteEvent::at(118, 125, 50, Polarity::on),
                                        AbsoluteEvent::at(118, 125, 51, Polarity::off)}));
  EXPECT_EQ(of_dvs.triggers, (std::vector<Trigger>{{52, 0, true}}));
}

TEST(Aedat2, WrapsAreFollowedThroughSilenceAndDisorder) {
  constexpr auto wrap = Microseconds{1} << 32;
  Events silence;
  for (int i = 0; i < 40; ++i)
    for (const int j : {0, 3})  // a wrap takes 71.6 minutes
      silence.push_back(AbsoluteEvent::at(i, i, 70LL * 60 * 1'000'000 * i + j, Polarity::on));
  Events disorder;
  for (const auto t : {wrap / 2 - 2, wrap / 2 - 3, wrap / 2 + 1, wrap / 2 - 1, wrap / 2 - 500})
    disorder.push_back(AbsoluteEvent::at(1, 1, t, Polarity::on));
  for (const auto& events : {silence, disorder})
    expect_events(aedat_files::aedat2_dvs128(events), events, dvs128);
}

TEST(Aedat2, TheHeaderOrTheUserTellsTheSizeOfADavis) {
  for (const SensorSize size : {SensorSize{240, 180}, davis346}) {
    const auto events = some_events(size);
    const auto text = std::to_string(size.width) + "x" + std::to_string(size.height);
    for (const std::string& line : {"# sensor size " + text + "\r\n", std::string()}) {
      const auto bytes = aedat_files::aedat2_v2e(events, size, line);
      const auto decoder = make_aedat2_decoder(line.empty() ? size : SensorSize{});
      EXPECT_TRUE(decode(*decoder, bytes).events == events) << line;
      EXPECT_EQ(decoder->size(), size);
      EXPECT_FALSE(decoder->streams().front().mirrored);
    }
  }
  auto bytes = aedat_files::aedat2_header("DAVI346");
  aedat_files::add_record(bytes, 7U << 22 | 3U << 12 | 1U << 11, 1000);
  const auto decoder = make_aedat2_decoder(davis346);
  EXPECT_EQ(decode(*decoder, bytes).events,
            std::vector{AbsoluteEvent::at(342, 252, 1000, Polarity::on)});
}

TEST(Aedat2, WithoutASizeEventsStayMirrored) {
  const SensorSize size{240, 180};
  const auto events = some_events(size);
  const auto decoder = make_aedat2_decoder();
  auto turned = decode(*decoder, aedat_files::aedat2_v2e(events, size), 1).events;
  EXPECT_EQ(decoder->size(), SensorSize{});
  EXPECT_TRUE(decoder->streams().front().mirrored);
  for (auto& event : turned)
    event = AbsoluteEvent::at(239 - event.x, 179 - event.y(), event.t, event.polarity());
  EXPECT_TRUE(turned == events);
  EXPECT_EQ(decoder->corruption().places + decoder->corruption().outside, 0U);
}

TEST(Aedat2, MissingBytesCostNoMoreThanTheNextFewRecords) {
  const auto events = recordings::random_events(dvs128, 2000, 4, 1'000'000'000, 1000);
  const auto sound = aedat_files::aedat2_dvs128(events);
  const auto data = sound.size() - 8 * events.size();
  for (std::size_t missing = 1; missing < 8; ++missing) {
    auto bytes = sound;
    const auto at = static_cast<std::ptrdiff_t>(data + 8 * 1000 + 3);
    bytes.erase(bytes.begin() + at, bytes.begin() + at + static_cast<std::ptrdiff_t>(missing));
    const auto decoder = make_aedat2_decoder();
    const auto found = decode(*decoder, bytes, 1).events;
    EXPECT_GE(found.size(), 1990U);
    EXPECT_TRUE(std::equal(events.end() - 990, events.end(), found.end() - 990)) << missing;
    EXPECT_EQ(decoder->corruption().places, 1U);
    EXPECT_NEAR(static_cast<double>(decoder->corruption().first_at), static_cast<double>(at), 16);
  }
}

TEST(Aedat2, ATimeFarFromItsNeighboursMovesNoOther) {
  const auto events = recordings::random_events(davis346, 100, 4, 1'000'000'000, 1000);
  auto bytes = aedat_files::aedat2_davis(events, davis346, "Davis346");
  bytes[bytes.size() - 8 * 50 + 4] ^= 0x40;
  bytes[bytes.size() - 8 * 30] |= 0x7f;  // a row outside the sensor
  const auto decoder = make_aedat2_decoder();
  auto expected = events;
  expected.erase(expected.begin() + 70);
  expected.erase(expected.begin() + 50);
  EXPECT_TRUE(decode(*decoder, bytes, 1).events == expected);
  EXPECT_EQ(decoder->corruption().places, 1U);
  EXPECT_EQ(decoder->corruption().outside, 1U);
}

TEST(Aedat2, ARecordingWithALongHeader) {
  const auto bytes = shared_data::events_file("aedat2-dvs128-header.aedat");
  if (bytes.empty()) GTEST_SKIP() << "no aedat2-dvs128-header.aedat in $SHARED_DATA";
  const auto decoder = make_aedat2_decoder();
  decode(*decoder, bytes, 1);
  EXPECT_EQ(decoder->size(), dvs128);
  // The content is "$$$...\r\n", which is no address of a DVS128; the last 6 bytes are a partial
  // record.
  EXPECT_EQ(decoder->corruption().places, 1U);
  EXPECT_EQ(decoder->corruption().first_at, 4241U);
}

TEST(Aedat3, PolarityEventsOfAllTimes) {
  for (const auto& [size, camera] : {std::pair{davis346, "DAVIS346C"}, {{2048, 2048}, "Other"}}) {
    const auto events = recordings::random_events(size, 30'000, 1, 0, 300 * hour);
    const auto bytes = aedat_files::aedat3(events, camera, 1000);
    EXPECT_TRUE(recordings::events_however_split([] { return make_aedat3_decoder(); }, bytes) ==
                events);
    const auto decoder = make_aedat3_decoder();
    decode(*decoder, bytes);
    EXPECT_EQ(decoder->size(), size == davis346 ? size : SensorSize{});
    EXPECT_EQ(decoder->corruption().places + decoder->corruption().outside, 0U);
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
  const auto decoder = make_aedat3_decoder();
  const auto out = decode(*decoder, bytes, 1);
  const auto base = Microseconds{1} << 31;
  EXPECT_EQ(out.events, (std::vector{AbsoluteEvent::at(5, 6, base + 201, Polarity::on)}));
  EXPECT_EQ(out.triggers, (std::vector<Trigger>{{base + 102, 0, true},
                                                {base + 103, 0, false},
                                                {base + 104, 0, true},
                                                {base + 107, 1, false},
                                                {base + 109, 2, true}}));
  EXPECT_EQ(decoder->corruption().places, 0U) << decoder->corruption().first;
}

TEST(EarlyAedat, WhatIsOfAnotherVersionIsRefused) {
  for (const std::string_view text : {"", "#", "#!AER-DAT3.1\r\n", "#!AER-DAT4.0\r\n",
                                      "% evt 3.0\n", "#!AER-DAT2.0\r\n# AEChip: Cochlea\r\n"}) {
    const auto decoder = make_aedat2_decoder();
    EXPECT_NE(recordings::refusal(*decoder, recordings::bytes_of(text)), "") << text;
  }
  for (const std::string_view text :
       {"", "#!AER-DAT2.0\r\n", "#!AER-DAT3.1\r\n", "#!AER-DAT3.1\r\nno end",
        "#!AER-DAT3.1\r\n#Format: Serial-TS\r\n#!END-HEADER\r\n"}) {
    const auto decoder = make_aedat3_decoder();
    EXPECT_NE(recordings::refusal(*decoder, recordings::bytes_of(text)), "") << text;
  }
}

TEST(Aedat3, ABrokenPacketCostsNoOther) {
  const auto events = recordings::random_events(davis346, 5000, 1, 0, 1000);
  const auto sound = aedat_files::aedat3(events, "DAVIS346", 1000);
  const auto header = aedat_files::aedat3_header("DAVIS346").size();
  constexpr std::size_t packet = 28 + 8000;
  const auto broken = [&](const char* what, std::size_t first_lost, std::size_t max_lost,
                          auto change) {
    SCOPED_TRACE(what);
    auto bytes = sound;
    change(bytes);
    for (const std::size_t piece : {SIZE_MAX, std::size_t{0}}) {
      const auto decoder = make_aedat3_decoder();
      const auto found = decode(*decoder, bytes, piece).events;
      ASSERT_GE(found.size() + max_lost, events.size());
      const auto before = static_cast<std::ptrdiff_t>(first_lost);
      EXPECT_TRUE(std::equal(events.begin(), events.begin() + before, found.begin()));
      EXPECT_TRUE(std::equal(events.end() - 3000, events.end(), found.end() - 3000));
      EXPECT_EQ(decoder->corruption().places, 1U) << decoder->corruption().first;
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
  const auto decoder = make_aedat3_decoder();
  EXPECT_EQ(decode(*decoder, bytes, 0).events.size(), 4998U);
  EXPECT_EQ(decoder->corruption().places, 1U);
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
      const auto decoder = make_aedat3_decoder();
      EXPECT_TRUE(decode(*decoder, bytes, piece).events == expected);
      EXPECT_EQ(decoder->corruption().outside, 5U);
      EXPECT_EQ(decoder->corruption().places, 0U) << decoder->corruption().first;
    }
  }
}

}  // namespace
