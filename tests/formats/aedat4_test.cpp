// SPDX-License-Identifier: LGPL-2.1-or-later
// AEDAT4: written files are read back equal; a recording of a camera gives the known counts;
// corrupt files lose only the corrupt parts.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <numeric>
#include <tuple>

#include "src/core/byte_order.hpp"
#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/aedat/aedat4_encoder.hpp"
#include "src/formats/compression/compressed_frames.hpp"
#include "tests/formats/aedat_files.hpp"
#include "tests/formats/recordings.hpp"
#include "tests/formats/shared_data.hpp"

namespace {

using namespace eventcamera;
using recordings::Bytes;
using recordings::decode;

constexpr Microseconds hour = 3'600'000'000;
constexpr std::array compressions{Aedat4Compression::none, Aedat4Compression::lz4,
                                  Aedat4Compression::lz4_high, Aedat4Compression::zstd,
                                  Aedat4Compression::zstd_high};

Bytes encoded(const Aedat4Settings& settings, std::span<const AbsoluteEvent> events) {
  Aedat4Encoder encoder(settings);
  auto bytes = recordings::encode(encoder, events, 1000);
  recordings::apply_patch(encoder, bytes);
  return bytes;
}

std::vector<AbsoluteEvent> some_events(std::size_t count, unsigned seed = 3,
                                       Microseconds start = 1'600'000'000'000'000) {
  return recordings::random_events({346, 260}, count, seed, start);
}

TEST(Aedat4, ReadsBackWhatItWrites) {
  unsigned seed = 1;
  for (const auto compression : compressions)
    for (const SensorSize size : {SensorSize{1, 1}, {346, 260}, {16384, 16384}})
      for (const bool table : {false, true}) {
        SCOPED_TRACE(testing::Message() << static_cast<int>(compression) << " " << size.width << "x"
                                        << size.height << " table " << table);
        const auto events =
            recordings::random_events(size, size.width == 1 ? 0 : 10'000, ++seed, -5, 200 * hour);
        const auto bytes = encoded({size, "made", compression, false, table}, events);
        const auto decoder = make_aedat4_decoder();
        const auto contents = decode(*decoder, bytes);
        ASSERT_EQ(decoder->streams().size(), 1U);
        EXPECT_EQ(decoder->streams()[0].size, size);
        EXPECT_EQ(decoder->streams()[0].source, "made");
        EXPECT_EQ(decoder->corruption().places, 0U) << decoder->corruption().first;
        EXPECT_EQ(decoder->corruption().outside, 0U);
        EXPECT_EQ(read_aedat4_header(bytes)->table_at.has_value(), table);
        ASSERT_TRUE(contents.events == events);
      }
}

TEST(Aedat4, FramesOfEveryFormatAmongEvents) {
  const auto events = some_events(100);
  for (const auto format :
       {PixelFormat::grey8, PixelFormat::grey16, PixelFormat::bgr, PixelFormat::bgra}) {
    Bytes pixels(64 * 50);
    std::iota(pixels.begin(), pixels.end(), std::uint8_t{0});
    const auto t = events[49].t;
    const Frame frame{t, t - 9, t + 9, t - 5, t + 5, format, 13, 50, 3, 4, pixels.data(), 64};
    Aedat4Encoder encoder(
        {{346, 260}, "a \"<camera>\" & more", Aedat4Compression::lz4, true, true});
    Bytes bytes;
    encoder.encode(std::span(events).first(50), bytes);
    encoder.encode(frame, bytes);
    encoder.encode(std::span(events).subspan(50), bytes);
    encoder.finish(bytes);
    const auto decoder = make_aedat4_decoder();
    const auto contents = decode(*decoder, bytes);
    ASSERT_EQ(decoder->streams().size(), 2U);
    EXPECT_EQ(decoder->streams()[1].kind, StreamKind::frames);
    EXPECT_EQ(decoder->streams()[1].source, "a \"<camera>\" & more");
    EXPECT_TRUE(contents.events == events);
    ASSERT_EQ(contents.pictures.size(), 1U);
    const auto numbers = [](const Frame& some) {
      return std::tuple(some.t, some.begin, some.end, some.exposure_begin, some.exposure_end,
                        some.format, some.x, some.y, some.width, some.height);
    };
    ASSERT_EQ(numbers(contents.pictures[0].frame), numbers(frame));
    const auto row = static_cast<std::size_t>(13 * bytes_per_pixel(format));
    for (std::size_t y = 0; y < 50; ++y)
      EXPECT_EQ(
          std::memcmp(contents.pictures[0].pixels.data() + y * row, pixels.data() + y * 64, row),
          0);
  }
}

TEST(Aedat4, FramesThatCannotBeWrittenAreRefused) {
  Bytes bytes;
  Aedat4Encoder without({{346, 260}, ""});
  std::uint8_t pixel = 0;
  Frame frame{0, 0, 0, 0, 0, PixelFormat::grey8, 1, 1, 0, 0, &pixel, 1};
  EXPECT_THROW(without.encode(frame, bytes), std::invalid_argument);
  Aedat4Encoder with({{346, 260}, "", Aedat4Compression::none, true});
  frame.width = 40'000;
  EXPECT_THROW(with.encode(frame, bytes), std::invalid_argument);
  EXPECT_THROW(Aedat4Encoder({{0, 260}, ""}), std::invalid_argument);
  EXPECT_THROW(Aedat4Encoder({{346, 16385}, ""}), std::invalid_argument);
}

/// Of each source that AEDAT 4 knows, in its order.
const std::vector<Trigger> triggers{
    {1000, 4, true},  {1001, 0, true}, {1002, 0, false}, {1003, 5, true}, {1004, 1, true},
    {1005, 1, false}, {1006, 2, true}, {1007, 2, false}, {1008, 3, true}, {1009, 3, false}};

TEST(Aedat4, EveryTriggerSource) {
  auto bytes = aedat_files::aedat4_header("");
  std::vector<aedat_files::TriggerSource> sources;
  for (int source = 0; source < 10; ++source) sources.push_back({1000 + source, source});
  aedat_files::add_packet(bytes, 3, aedat_files::triggers_content(sources));
  const auto decoder = make_aedat4_decoder();
  EXPECT_EQ(decode(*decoder, bytes).triggers, triggers);
  EXPECT_EQ(decoder->streams()[0].kind, StreamKind::triggers);
  EXPECT_EQ(decoder->corruption().places, 0U) << decoder->corruption().first;
}

TEST(Aedat4, KeepsTriggersAndImuSamples) {
  auto with_unknown = triggers;
  with_unknown.push_back({1010, 7, true});
  const std::vector<ImuSample> samples{
      {.t = 1500, .temperature = 39.5F, .acceleration = {0.1F, -0.9F, 0.25F}},
      {.t = 2500, .rotation = {1, -2, 3.5F}, .magnetic_field = {-40, 20.25F, 0}}};
  for (const auto compression : {Aedat4Compression::none, Aedat4Compression::zstd}) {
    Aedat4Encoder encoder({.size = {346, 260},
                           .source = "a camera",
                           .compression = compression,
                           .triggers = true,
                           .imu_samples = true});
    Bytes bytes;
    EXPECT_EQ(encoder.encode(std::span<const Trigger>(with_unknown), bytes), triggers.size());
    EXPECT_EQ(encoder.encode(std::span<const ImuSample>(samples), bytes), samples.size());
    encoder.finish(bytes);
    const auto decoder = make_aedat4_decoder();
    const auto contents = decode(*decoder, bytes);
    EXPECT_EQ(contents.triggers, triggers);
    EXPECT_EQ(contents.imu_samples, samples);
    ASSERT_EQ(decoder->streams().size(), 3U);
    EXPECT_EQ(decoder->streams()[1].kind, StreamKind::triggers);
    EXPECT_EQ(decoder->streams()[2].kind, StreamKind::imu);
    EXPECT_EQ(decoder->corruption().places, 0U) << decoder->corruption().first;
  }
  Aedat4Encoder without({{346, 260}, ""});
  Bytes bytes;
  EXPECT_EQ(without.encode(std::span<const Trigger>(triggers), bytes), 0U);
  EXPECT_EQ(without.encode(std::span<const ImuSample>(samples), bytes), 0U);
}

TEST(Aedat4, AlignmentMayCountFromAnywhere) {
  const std::vector<aedat_files::TriggerSource> sources{{1000, 1}, {1001, 2}};
  const std::vector<Aedat4TableEntry> entries{{110, 0, 50, 10, 5, 9}, {168, 1, 20, 1, 7, 7}};
  const auto table = aedat4_table_content(entries);
  const Bytes table_body(table.begin() + 4, table.end());
  for (const std::size_t off_by : {0, 1, 2, 4}) {
    SCOPED_TRACE(off_by);
    auto bytes = aedat_files::aedat4_header("", 0, 5000, off_by);
    aedat_files::add_packet(bytes, 7, aedat_files::triggers_content(sources, off_by));
    const auto decoder = make_aedat4_decoder();
    EXPECT_EQ(decode(*decoder, bytes).triggers,
              (std::vector<Trigger>{{1000, 0, true}, {1001, 0, false}}));
    EXPECT_EQ(read_aedat4_header(bytes)->table_at, 5000U);
    EXPECT_EQ(decoder->corruption().places, 0U) << decoder->corruption().first;

    const auto of_xml = make_aedat4_decoder();
    decode(*of_xml, aedat_files::aedat4_header(aedat_files::xml_of_one_stream, 0, -1, off_by));
    ASSERT_EQ(of_xml->streams().size(), 1U);
    EXPECT_EQ(of_xml->streams()[0].size, (SensorSize{346, 260}));

    const auto moved = aedat_files::moved(table_body, off_by);
    Bytes content;
    aedat_files::add_little(content, static_cast<std::int64_t>(moved.size()), 4);
    aedat_files::add(content, moved);
    EXPECT_EQ(read_aedat4_table(content, Aedat4Compression::none, 110), entries);
  }
}

TEST(Aedat4, EventsOutsideOrWithoutATimeAreCountedAndUnsortedOnesKept) {
  constexpr auto far = std::numeric_limits<Microseconds>::max();
  const auto at = [](int x, int y, Microseconds t) {
    return AbsoluteEvent::at(x, y, t, Polarity::on);
  };
  const std::vector<AbsoluteEvent> events{at(345, 259, 100), at(346, 0, 101),    at(0, 260, 102),
                                          at(5, 5, 90),      at(1, 1, -far - 1), at(5, 6, 95),
                                          at(1, 3, far),     at(32767, 1, 99),   at(5, 6, 100)};
  auto bytes = aedat_files::aedat4_header(aedat_files::xml_of_one_stream);
  aedat_files::add_packet(bytes, 0, aedat_files::events_content(events));
  const auto decoder = make_aedat4_decoder();
  EXPECT_TRUE(decode(*decoder, bytes).events ==
              (std::vector{events[0], events[3], events[5], events[8]}));
  EXPECT_EQ(decoder->corruption().outside, 3U);
  EXPECT_EQ(decoder->corruption().places, 2U) << "impossible times";
}

TEST(Aedat4, WhatIsNotAedat4IsRefused) {
  const auto unknown_compression = aedat_files::aedat4_header("", 9);
  std::vector<std::string> texts{"",
                                 "% evt 3.0\n",
                                 "#!AER-DAT2.0\r\n",
                                 "#!AER-DAT4.0\r\n",
                                 std::string("#!AER-DAT4.0\r\n\x40\0\0\0 and no more", 31),
                                 "#!AER-DAT4.0\r\n\xff\xff\xff\x7f",
                                 std::string("#!AER-DAT4.0\r\n\x10\0\0\0 and no FlatBuffer", 36),
                                 {unknown_compression.begin(), unknown_compression.end()}};
  for (const char size : {0, 1, 4, 7, 8})
    texts.push_back(std::string("#!AER-DAT4.0\r\n") + size +
                    std::string(3 + static_cast<std::size_t>(size), '\0'));
  for (const auto& text : texts) {
    const auto decoder = make_aedat4_decoder();
    EXPECT_THROW(decode(*decoder, recordings::bytes_of(text)), UnsupportedFormat) << text;
  }
}

TEST(Aedat4, AnXmlCutAnywhereOrCorruptLosesNoStream) {
  const std::string_view xml =
      "<dv><node name='outInfo'><node name='0'><attr key='typeIdentifier'>EVTS</attr></node>"
      "<node name='1'><attr key='typeIdentifier'>TRIG</attr></node></node></dv>";
  const auto events = some_events(10);
  const std::vector<aedat_files::TriggerSource> sources{{1000, 1}, {1001, 2}};
  std::vector<std::string_view> texts{"</node></node>", "no XML"};
  for (std::size_t size = 0; size <= xml.size(); ++size) texts.push_back(xml.substr(0, size));
  for (const auto text : texts) {
    SCOPED_TRACE(text);
    auto bytes = aedat_files::aedat4_header(text);
    aedat_files::add_packet(bytes, 0, aedat_files::events_content(events));
    aedat_files::add_packet(bytes, 1, aedat_files::triggers_content(sources));
    const auto decoder = make_aedat4_decoder();
    const auto found = decode(*decoder, bytes);
    ASSERT_EQ(decoder->streams().size(), 2U);
    EXPECT_TRUE(found.events == events);
    EXPECT_EQ(found.triggers.size(), 2U);
    EXPECT_EQ(decoder->corruption().places, text.empty() || text == xml ? 0U : 1U);
  }
}

TEST(Aedat4, HostileXmlTakesTimeInProportion) {
  const auto repeated = [](std::string_view text) {
    std::string many;
    for (int i = 0; i < 1'000'000; ++i) many += text;
    return many;
  };
  for (const auto& xml : {"<dv><node " + repeated(" x=''") + "/></dv>",
                          "<dv>" + repeated("<node>") + repeated("</node>") + "</dv>"}) {
    const auto decoder = make_aedat4_decoder();
    decode(*decoder, aedat_files::aedat4_header(xml));
    EXPECT_EQ(decoder->corruption().places, 0U);
  }
}

TEST(Aedat4, EntitiesThatTheXmlDeclaresAreNotExpanded) {
  std::string xml = "<!DOCTYPE dv [<!ENTITY many '&#65;&#65;'>]>";
  xml += aedat_files::xml_of_one_stream;
  xml.insert(xml.find("<attr key=\"sizeX"), "<attr key='source'>&many; &#65;</attr>");
  const auto decoder = make_aedat4_decoder();
  decode(*decoder, aedat_files::aedat4_header(xml));
  ASSERT_EQ(decoder->streams().size(), 1U);
  EXPECT_EQ(decoder->streams()[0].source, "&many; A");
  EXPECT_EQ(decoder->corruption().places, 0U);
}

TEST(Aedat4, ASizeOfWhichOneSideIsMissingIsNone) {
  std::string xml(aedat_files::xml_of_one_stream);
  xml.replace(xml.find("sizeY"), 5, "sizeZ");
  auto bytes = aedat_files::aedat4_header(xml);
  const std::vector events{AbsoluteEvent::at(400, 300, 1000, Polarity::on)};
  aedat_files::add_packet(bytes, 0, aedat_files::events_content(events));
  const auto decoder = make_aedat4_decoder();
  EXPECT_TRUE(decode(*decoder, bytes).events == events);
  EXPECT_EQ(decoder->streams()[0].size, SensorSize{});
}

TEST(Aedat4, ATableFoundWhereTheHeaderNamesNoneIsNoCorruption) {
  for (const auto compression : compressions) {
    Aedat4Encoder encoder({{346, 260}, "", compression, false, true});
    const auto events = some_events(9000);
    const auto bytes = recordings::encode(encoder, events);  // without patching the header
    const auto decoder = make_aedat4_decoder();
    EXPECT_TRUE(decode(*decoder, bytes, 100).events == events);
    EXPECT_FALSE(read_aedat4_header(bytes)->table_at);
    EXPECT_EQ(decoder->corruption().places, 0U) << decoder->corruption().first;
  }
}

/// Positions of the packet headers, and of the end.
std::vector<std::size_t> packets_of(std::span<const std::uint8_t> bytes) {
  const auto header = read_aedat4_header(bytes).value();
  const auto end = header.table_at.value_or(bytes.size());
  std::vector<std::size_t> found;
  for (std::size_t at = header.packets_at; at < end;
       at += 8 + little_endian<std::uint32_t>(&bytes[at + 4]))
    found.push_back(at);
  return found;
}

TEST(Aedat4, ABrokenPacketIsLostAndNoOther) {
  const auto events = some_events(20'000);
  for (const auto compression : compressions)
    for (const bool table : {false, true}) {
      const auto sound = encoded({{346, 260}, "", compression, false, table}, events);
      const auto at = packets_of(sound);
      const auto broken = [&](const char* what, int lost, auto breaking) {
        SCOPED_TRACE(testing::Message() << what << ", compression " << static_cast<int>(compression)
                                        << ", table " << table);
        auto bytes = sound;
        breaking(bytes);
        auto expected = events;
        expected.erase(expected.begin() + 4096 * lost,
                       expected.begin() + std::min(4096 * (lost + 1), 20'000));
        for (const std::size_t piece : {std::size_t{1} << 20, std::size_t{1000}}) {
          const auto decoder = make_aedat4_decoder();
          const auto contents = decode(*decoder, bytes, piece);
          EXPECT_TRUE(contents.events == expected);
          EXPECT_EQ(decoder->corruption().places, 1U) << decoder->corruption().first;
          EXPECT_EQ(decoder->corruption().first_at, at[static_cast<std::size_t>(lost)]);
        }
      };
      const auto set = [](Bytes& bytes, std::size_t place, std::uint32_t number) {
        std::memcpy(bytes.data() + place, &number, sizeof number);
      };
      broken("size larger", 1, [&](Bytes& b) {
        set(b, at[1] + 4, 60'000'000);
        if (compression == Aedat4Compression::none) set(b, at[1] + 8, 0xffffffff);
      });
      broken("size negative", 1, [&](Bytes& b) { set(b, at[1] + 4, 0x80000001); });
      broken("stream", 2, [&](Bytes& b) { set(b, at[2], 77); });
      broken("no magic", 2, [&](Bytes& b) { set(b, at[2] + 8, 0xffffffff); });
      broken("payload rubbed out", 1, [&](Bytes& b) {
        std::fill_n(&b[at[1] + 16], little_endian<std::uint32_t>(&b[at[1] + 4]) - 16, 0xff);
      });
      broken("bytes missing", 2, [&](Bytes& b) {
        b.erase(b.begin() + static_cast<std::ptrdiff_t>(at[2] + 30),
                b.begin() + static_cast<std::ptrdiff_t>(at[2] + 1030));
      });
      if (!table) broken("cut off", 4, [&](Bytes& b) { b.resize(b.size() - 100); });
    }
}

TEST(Aedat4, BytesBetweenPacketsAreSkipped) {
  const auto events = some_events(9000);
  for (const auto compression : compressions) {
    auto bytes = encoded({{346, 260}, "", compression, false, false}, events);
    const auto at = packets_of(bytes);
    const Bytes noise(333, 0xa5);
    bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at[1]), noise.begin(), noise.end());
    const auto decoder = make_aedat4_decoder();
    EXPECT_TRUE(decode(*decoder, bytes, 50).events == events);
    EXPECT_EQ(decoder->corruption().places, 1U);
    EXPECT_EQ(decoder->corruption().first_at, at[1]);
  }
}

TEST(Aedat4, BombsAreCappedAndSkipped) {
  const auto events = some_events(1000);
  for (const auto compression : {Aedat4Compression::lz4, Aedat4Compression::zstd}) {
    auto bytes = encoded({{346, 260}, "", compression, false, false}, events);
    const Bytes packet(bytes.begin() + static_cast<std::ptrdiff_t>(packets_of(bytes)[0]),
                       bytes.end());
    Bytes bomb;
    FrameCompressor(compression == Aedat4Compression::lz4 ? FrameCodec::lz4 : FrameCodec::zstd)
        .compress(Bytes(aedat4_max_packet + 1), bomb);
    aedat_files::add_packet(bytes, 0, bomb);
    aedat_files::add(bytes, packet);
    const auto decoder = make_aedat4_decoder();
    EXPECT_EQ(decode(*decoder, bytes).events.size(), 2000U);
    EXPECT_EQ(decoder->corruption().places, 1U);
  }
}

/// Each packet states a size that includes all following ones. Searching each of them completely
/// would take hours.
TEST(Aedat4, PacketsWithinPacketsTakeNoTimeToSpeakOf) {
  for (const auto compression : {Aedat4Compression::none, Aedat4Compression::lz4}) {
    auto bytes = encoded({{346, 260}, "", compression, false, false}, {});
    const auto begin = bytes.size();
    while (bytes.size() < begin + (std::size_t{8} << 20)) {
      aedat_files::add_little(bytes, 0, 4);
      aedat_files::add_little(bytes, 1 << 20, 4);
      if (compression == Aedat4Compression::none) {
        aedat_files::add_little(bytes, (1 << 20) - 4, 4);
        aedat_files::add_little(bytes, 4, 4);
        aedat_files::add(bytes, "EVTS");
      } else {
        // A frame with an uncompressed block of maximum size.
        for (const int byte : {0x04, 0x22, 0x4d, 0x18, 0x40, 0x40, 0xc0})
          bytes.push_back(static_cast<std::uint8_t>(byte));
        aedat_files::add_little(bytes, std::int64_t{0x80010000}, 4);
      }
    }
    const auto decoder = make_aedat4_decoder();
    EXPECT_TRUE(decode(*decoder, bytes).events.empty());
    EXPECT_GE(decoder->corruption().places, 1U);
  }
}

/// A table with this many entries, all of which share the same bytes.
Bytes shared_table(int entries) {
  Bytes bytes;
  const auto add = [&](std::initializer_list<int> numbers, int size) {
    for (const int number : numbers) aedat_files::add_little(bytes, number, size);
  };
  const int entry = 32 + 4 * entries + 12;  // 4 past a multiple of 8, as they are even
  add({entry + 20 - 4, 16}, 4);
  aedat_files::add(bytes, "FTAB");
  add({6, 8, 4, 0}, 2);
  add({8, 4, entries}, 4);
  for (int i = 0; i < entries; ++i) add({entry - 32 - 4 * i}, 4);
  add({8, 20, 4, 12, 0, 0}, 2);
  add({12, 100, 0, 0, 50}, 4);
  return bytes;
}

TEST(Aedat4, EntriesOfATableDoNotShareTheirBytes) {
  EXPECT_EQ(read_aedat4_table(shared_table(2), Aedat4Compression::none, 18).value().size(), 2U);
  EXPECT_FALSE(read_aedat4_table(shared_table(10'000), Aedat4Compression::none, 18));
}

TEST(Aedat4, TablesWithThePositionsOfHeadersAreUnderstood) {
  // The first packet is at 1008 and its payload at 1016.
  std::vector<Aedat4TableEntry> entries{{1008, 0, 50, 10, 5, 9}, {1066, 1, 20, 1, 7, 7}};
  EXPECT_EQ(*read_aedat4_table(aedat4_table_content(entries), Aedat4Compression::lz4, 1008),
            entries);
  auto of_headers = entries;
  for (auto& entry : of_headers) entry.position -= 8;
  EXPECT_EQ(*read_aedat4_table(aedat4_table_content(of_headers), Aedat4Compression::zstd, 1008),
            entries);
  EXPECT_FALSE(read_aedat4_table(Bytes(100, 3), Aedat4Compression::none, 18));
  const auto content = aedat4_table_content(entries);
  for (std::uint8_t size = 0; size < content.size(); ++size) {
    Bytes part(content.begin(), content.begin() + size);
    EXPECT_FALSE(read_aedat4_table(part, Aedat4Compression::lz4, 18));
    if (size < 4 || size >= 12) continue;
    part[0] = static_cast<std::uint8_t>(size - 4);
    EXPECT_FALSE(read_aedat4_table(part, Aedat4Compression::none, 18));
  }
}

TEST(Aedat4, ARecordingOfADavis346) {
  const auto bytes = shared_data::events_file("davis346-frames-events-imu.aedat4");
  if (bytes.empty()) GTEST_SKIP() << "no davis346-frames-events-imu.aedat4 in $SHARED_DATA";
  const auto decoder = make_aedat4_decoder();
  const auto contents = decode(*decoder, bytes, 0);
  ASSERT_EQ(decoder->streams().size(), 4U);
  EXPECT_EQ(decoder->streams()[0].size, (SensorSize{346, 260}));
  EXPECT_EQ(decoder->streams()[0].source, "DAVIS346_00000104");
  EXPECT_EQ(contents.events.size(), 117'667U);
  EXPECT_EQ(std::ranges::count(contents.events, Polarity::on, &AbsoluteEvent::polarity), 72'363);
  ASSERT_EQ(contents.pictures.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto& frame = contents.pictures[i].frame;
    EXPECT_EQ((SensorSize{frame.width, frame.height}), (SensorSize{346, 260}));
    EXPECT_EQ(frame.format, PixelFormat::grey8);
    EXPECT_EQ(frame.t - contents.pictures[0].frame.t, static_cast<Microseconds>(i) * 40'000);
  }
  EXPECT_EQ(contents.triggers.size(), 15U);
  ASSERT_EQ(contents.imu_samples.size(), 130U);
  for (const auto& sample : contents.imu_samples) {
    const auto [x, y, z] = sample.acceleration;
    EXPECT_NEAR(std::hypot(x, y, z), 1, 0.2) << "gravity";
    EXPECT_NEAR(sample.temperature, 40, 20);
  }
  EXPECT_EQ(decoder->corruption().places + decoder->corruption().outside, 0U);
  const auto header = read_aedat4_header(bytes).value();
  const auto table = read_aedat4_table(std::span(bytes).subspan(*header.table_at),
                                       header.compression, header.packets_at);
  ASSERT_TRUE(table);
  EXPECT_EQ(table->size(), 40U);
  EXPECT_EQ(table->front().position, header.packets_at);
}

}  // namespace
