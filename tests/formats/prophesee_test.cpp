// SPDX-License-Identifier: LGPL-2.1-or-later
// Prophesee RAW files and their words: encoding word by word, and decoding of hand-made words.
#include <gtest/gtest.h>

#include <cstring>
#include <stdexcept>

#include "src/formats/evt/raw.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using recordings::decode;
using recordings::encode;
using Bytes = std::vector<std::uint8_t>;

constexpr SensorSize vga{640, 480};
constexpr auto off = Polarity::off;
constexpr auto on = Polarity::on;

template <class Word>
Bytes bytes_of(std::initializer_list<Word> words) {
  Bytes bytes(words.size() * sizeof(Word));
  std::memcpy(bytes.data(), words.begin(), bytes.size());
  return bytes;
}

Bytes evt3(std::initializer_list<std::uint16_t> words) {
  return bytes_of(words);
}

Bytes words32(std::initializer_list<std::uint32_t> words) {
  return bytes_of(words);
}

struct Read {
  Decoded decoded;
  Corruption corruption;
};

Read read(EvtFormat format, const Bytes& bytes, SensorSize size = vga) {
  const auto decoder = make_evt_decoder(format, size);
  auto decoded = decode(*decoder, bytes);
  return {decoded, decoder->corruption()};
}

std::vector<AbsoluteEvent> events(std::initializer_list<AbsoluteEvent> list) {
  return list;
}

// Encoding.

TEST(Written, Evt4KeepsTimeAliveThroughSilence) {
  const auto recording =
      events({AbsoluteEvent::at(1, 2, 5, on), AbsoluteEvent::at(1, 2, 3'000'005, on)});
  const auto bytes = encode(*make_evt_encoder(EvtFormat::evt4, vga), recording);
  // One step per 960 us, and the two events.
  EXPECT_EQ(bytes.size() / 4, 1U + 3'000'000 / 960 + 2U);
  EXPECT_EQ(read(EvtFormat::evt4, bytes).decoded.events, recording);
}

TEST(Written, Evt4IsBelievedAfterEveryWrap) {
  for (const auto start : {Microseconds{0}, Microseconds{1} << 34}) {
    const auto recording =
        events({AbsoluteEvent::at(1, 2, start + (Microseconds{1} << 34) - 700, on),
                AbsoluteEvent::at(3, 4, start + (Microseconds{1} << 34) + 700, off)});
    const auto bytes = encode(*make_evt_encoder(EvtFormat::evt4, vga), recording);
    EXPECT_LT(bytes.size(), 100U);
    EXPECT_EQ(read(EvtFormat::evt4, bytes).decoded.events, recording);
  }
}

TEST(Written, Evt4HasNoVectorPastTheSensor) {
  std::vector<AbsoluteEvent> row;
  for (int x = 0; x < 351; ++x) row.push_back(AbsoluteEvent::at(x, 7, 9, on));
  const auto bytes = encode(*make_evt_encoder(EvtFormat::evt4, {351, 260}), row);
  // Ten vectors, and 31 events.
  EXPECT_EQ(bytes.size() / 4, 1U + 10 * 2U + 31U);
  EXPECT_EQ(read(EvtFormat::evt4, bytes, {351, 260}).decoded.events, row);
}

TEST(Written, Evt3GroupsWhatPays) {
  std::vector<AbsoluteEvent> row;
  for (int x = 100; x < 104; ++x) row.push_back(AbsoluteEvent::at(x, 7, 9, on));
  const auto written = [&] { return encode(*make_evt_encoder(EvtFormat::evt3, vga), row); };
  EXPECT_EQ(written(), evt3({0x8000, 0x6009, 0x0007, 0x2864, 0x2865, 0x2866, 0x2867}));
  row.push_back(AbsoluteEvent::at(131, 7, 9, on));
  EXPECT_EQ(written(), evt3({0x8000, 0x6009, 0x0007, 0x3864, 0x400f, 0x4000, 0x5080}));
  row.push_back(AbsoluteEvent::at(132, 7, 9, on));
  EXPECT_EQ(written(), evt3({0x8000, 0x6009, 0x0007, 0x3864, 0x400f, 0x4000, 0x5080, 0x2884}));
}

TEST(Written, Evt3KeepsTimeAliveThroughSilence) {
  const auto recording =
      events({AbsoluteEvent::at(1, 2, 5, on), AbsoluteEvent::at(1, 2, 20'000'000, on)});
  const auto bytes = encode(*make_evt_encoder(EvtFormat::evt3, vga), recording);
  // One step per 4096 us, and 2 more words at the second event.
  EXPECT_EQ(bytes.size() / 2, 4U + 20'000'000 / 4096 + 2U);
}

TEST(Written, TriggersAreOfInputsThatTheWordsCanName) {
  for (const auto format : {EvtFormat::evt2, EvtFormat::evt21, EvtFormat::evt21_legacy,
                            EvtFormat::evt3, EvtFormat::evt4}) {
    const std::uint16_t last = format == EvtFormat::evt3 ? 15 : 31;
    const auto encoder = make_evt_encoder(format, vga);
    Bytes bytes;
    EXPECT_TRUE(encoder->encode_trigger({5, last, true}, bytes));
    const auto before = bytes;
    for (const int id : {last + 1, 63, 65535})
      EXPECT_FALSE(encoder->encode_trigger({6, static_cast<std::uint16_t>(id), true}, bytes));
    EXPECT_EQ(bytes, before);
    EXPECT_EQ(read(format, bytes).decoded.triggers, (std::vector<Trigger>{{5, last, true}}));
  }
}

TEST(Written, HeadersAreThese) {
  const auto text = [](EvtFormat format) {
    const auto bytes = encode(*make_prophesee_raw_encoder(format, {1280, 720}), {});
    return std::string(bytes.begin(), bytes.end());
  };
  const auto expected = [](const std::string& evt, const std::string& format) {
    return "% camera_integrator_name Prophesee\n% evt " + evt + "\n% format " + format +
           ";height=720;width=1280\n% geometry 1280x720\n% plugin_integrator_name "
           "Prophesee\n% end\n";
  };
  EXPECT_EQ(text(EvtFormat::evt2), expected("2.0", "EVT2"));
  EXPECT_EQ(text(EvtFormat::evt21), expected("2.1", "EVT21;endianness=little"));
  EXPECT_EQ(text(EvtFormat::evt21_legacy), expected("2.1", "EVT21;endianness=legacy"));
  EXPECT_EQ(text(EvtFormat::evt3), expected("3.0", "EVT3"));
  EXPECT_EQ(text(EvtFormat::evt4), expected("4.0", "EVT4"));
}

TEST(Written, IsForSensorsThatTheWordsCanAddress) {
  EXPECT_THROW(make_prophesee_raw_encoder(EvtFormat::evt3, {2049, 1}), std::invalid_argument);
  EXPECT_THROW(make_evt_encoder(EvtFormat::evt2, {1, 0}), std::invalid_argument);
}

// Headers.

std::unique_ptr<EventDecoder> decoder_after(const std::string& header, Decoded& decoded) {
  auto decoder = make_prophesee_raw_decoder();
  Bytes bytes(header.begin(), header.end());
  decoder->decode(bytes, decoded);
  decoder->finish(decoded);
  return decoder;
}

/// EVT2 event at (3, 2), 1 us, after a header.
std::string with_evt2(const std::string& header) {
  const auto bytes = words32({0x80000000, 0x10000000 | 1 << 22 | 3 << 11 | 2});
  return header + std::string(bytes.begin(), bytes.end());
}

void expect_evt2(const std::string& header, SensorSize size) {
  Decoded decoded;
  const auto decoder = decoder_after(with_evt2(header), decoded);
  EXPECT_EQ(decoded.events, events({AbsoluteEvent::at(3, 2, 1, on)})) << header;
  EXPECT_EQ(decoder->size(), size);
  EXPECT_EQ(decoder->corruption().places, 0U);
}

TEST(RawHeader, IsReadAsWritersWriteIt) {
  expect_evt2("% format EVT2;height=480;width=640\n% end\n", vga);
  expect_evt2("% format EVT2\n% geometry 640x480\n% generator x\n% end\n", vga);
  expect_evt2("% evt 2.0\n% geometry 640x480\n% end\n", vga);
  expect_evt2("% date 2019-01-01 10:11:12\n% evt 2.0\n", {});  // older: without an end
  expect_evt2("% evt 2.0\r\n%  geometry   640x480 \r\n% t0 123\n% end\r\n", vga);
  expect_evt2("% evt 3.0\n% format EVT2;width=640;height=480\n% geometry 1x1\n% end\n", vga);
  expect_evt2("% evt 2.0\n% geometry 99999999999x480\n% end\n", {});
  expect_evt2("% evt 2.0\n%\n% geometry -5x480\n% end\n", {});
}

TEST(RawHeader, MayHaveZerosAtTheEndsOfLines) {
  using namespace std::string_literals;
  expect_evt2("% evt 2.0\n% geometry 640x480\0% serial_number 1\n% end\n"s, vga);
  expect_evt2("% evt 2.0\0% geometry 640x480\0\0\n% end\n"s, vga);
  // However the bytes come.
  const auto file = with_evt2("% evt 2.0\n% geometry 640x480\0% integrator_name x\n% end\n"s);
  const auto decoder = make_prophesee_raw_decoder();
  Decoded decoded;
  for (const char byte : file)
    decoder->decode(std::span(reinterpret_cast<const std::uint8_t*>(&byte), 1), decoded);
  decoder->finish(decoded);
  EXPECT_EQ(decoded.events, events({AbsoluteEvent::at(3, 2, 1, on)}));
  EXPECT_EQ(decoder->size(), vga);
}

TEST(RawHeader, TellsTheSizeOfAKnownCamera) {
  expect_evt2("% evt 2.0\n% plugin_name hal_plugin_gen31_fx3\n% end\n", vga);
  expect_evt2("% evt 2.0\n% plugin_name hal_plugin_imx636_evk4\n% system_ID 49\n% end\n",
              {1280, 720});
  expect_evt2("% evt 2.0\n% sensor_name GenX320\n% end\n", {320, 320});
  expect_evt2("% evt 2.0\n% sensor_generation 4.1\n% end\n", {1280, 720});
  expect_evt2("% evt 2.0\n% system_ID 41\n% end\n", vga);
  expect_evt2("% evt 2.0\n% system_ID 64\n% end\n", {320, 320});
  expect_evt2("% evt 2.0\n% system_ID 52\n% end\n", {640, 512});
  expect_evt2("% evt 2.0\n% plugin_name other\n% system_ID 4711\n% end\n", {});
  expect_evt2("% evt 2.0\n% geometry 320x240\n% system_ID 49\n% end\n", {320, 240});
}

TEST(RawHeader, TakesDataThatBeginAsALineDoesForData) {
  // 0x2025 are the low 16 bits of an EVT2 event, before which the header did not end.
  const auto bytes = words32({0x00002025, 0x80000000, 0x10000000 | 3 << 11});
  Decoded decoded;
  decoder_after("% evt 2.0\n" + std::string(bytes.begin(), bytes.end()), decoded);
  EXPECT_EQ(decoded.events, events({AbsoluteEvent::at(3, 0, 0, on)}));
}

TEST(RawHeader, TellsTheOrderOfEvt21) {
  const auto expect_order = [](const std::string& header, bool legacy) {
    const auto little = words32({0, 0x80000000, 1, 0x10000000});
    const auto other = words32({0x80000000, 0, 0x10000000, 1});
    const auto& bytes = legacy ? other : little;
    Decoded decoded;
    decoder_after(header + std::string(bytes.begin(), bytes.end()), decoded);
    EXPECT_EQ(decoded.events, events({AbsoluteEvent::at(0, 0, 0, on)})) << header;
  };
  expect_order("% format EVT21;height=480;width=640\n% end\n", false);
  expect_order("% format EVT21;endianness=little;height=480;width=640\n% end\n", false);
  expect_order("% format EVT21;endianness=legacy;height=480;width=640\n% end\n", true);
  expect_order("% format EVT21;height=480;width=640;endianness=legacy\n% end\n", true);
  expect_order("% endianness legacy\n% format EVT21;height=480;width=640\n% end\n", true);
  expect_order("% evt 2.1\n% system_ID 49\n% end\n", true);
  expect_order("% evt 2.1\n% geometry 320x320\n% system_ID 49\n% end\n", false);
}

TEST(RawHeader, IsAnErrorThatSaysWhy) {
  const auto error = [](const std::string& file) {
    return recordings::refusal(*make_prophesee_raw_decoder(), Bytes(file.begin(), file.end()));
  };
  EXPECT_NE(error(""), "");
  EXPECT_NE(error("%"), "");
  EXPECT_NE(error("GIF89a"), "");
  EXPECT_NE(error("%PDF-1.4\n"), "");
  EXPECT_NE(error(std::string(1000, '\0')), "");
  EXPECT_NE(error("% date 1\n% end\n").find("format"), std::string::npos);
  EXPECT_NE(error("% format HISTO3D;height=1;width=1\n% end\n").find("HISTO3D"), std::string::npos);
  EXPECT_NE(error("% format EVT21;endianness=big\n% end\n").find("big"), std::string::npos);
  EXPECT_NE(error("% evt 9.9\n% end\n"), "");
  std::string endless;
  while (endless.size() < 1'000'000) endless += "% a b\n";
  EXPECT_NE(error(endless), "");
  EXPECT_NE(error("% " + std::string(1'000'000, 'x')), "");
}

// EVT2.

TEST(Evt2, ReadsEventsAndTriggersAndPassesOverTheRest) {
  const auto [decoded, corruption] =
      read(EvtFormat::evt2,
           words32({0x10000000 | 1 << 11,  // before any time
                    0x80000002,            // 128 us
                    0x00000000 | 5 << 22 | 639 << 11 | 479, 0xe0000000, 0xf0000001,
                    0xd0000000,                         // others, continued, IMU
                    0xa0000000 | 6 << 22 | 1 << 8 | 1,  // rising trigger on input 1
                    0xa0000000 | 7 << 22 | 1 << 8,      // falling edge
                    0x10000000 | 63U << 22}));
  EXPECT_EQ(decoded.events,
            events({AbsoluteEvent::at(639, 479, 133, off), AbsoluteEvent::at(0, 0, 191, on)}));
  EXPECT_EQ(decoded.triggers, (std::vector<Trigger>{{134, 1, true}, {135, 1, false}}));
  EXPECT_EQ(corruption.places, 0U);
}

TEST(Evt2, FollowsTheWrapOf34Bits) {
  const auto [decoded, corruption] =
      read(EvtFormat::evt2, words32({0x8fffffff, 0x10000000 | 63U << 22, 0x80000000, 0x10000000,
                                     0x8fffffff, 0x8fffffff, 0x80000000, 0x10000000}));
  const auto lap = Microseconds{1} << 34;
  EXPECT_EQ(decoded.events,
            events({AbsoluteEvent::at(0, 0, lap - 1, on), AbsoluteEvent::at(0, 0, lap, on),
                    AbsoluteEvent::at(0, 0, 2 * lap, on)}));
}

TEST(Evt2, KeepsDisorderAndCountsWhatIsOutside) {
  const auto [decoded, corruption] = read(
      EvtFormat::evt2, words32({0x80000064, 0x10000000, 0x80000063, 0x10000000 | 1 << 11,
                                0x80000065, 0x10000000, 0x10000000 | 640 << 11, 0x10000000 | 480}));
  EXPECT_EQ(decoded.events,
            events({AbsoluteEvent::at(0, 0, 6400, on), AbsoluteEvent::at(1, 0, 6336, on),
                    AbsoluteEvent::at(0, 0, 6464, on)}));
  EXPECT_EQ(corruption.outside, 2U);
  EXPECT_EQ(corruption.places, 1U);
}

TEST(Evt2, CountsBrokenWordsByPlaces) {
  const auto [decoded, corruption] =
      read(EvtFormat::evt2, words32({0x80000000, 0x10000000, 0x20000000, 0x30000000, 0x10000000,
                                     0x90000000, 0x10000000}));
  EXPECT_EQ(decoded.events.size(), 3U);
  EXPECT_EQ(corruption.places, 2U);
  EXPECT_EQ(corruption.first_at, 8U);
  EXPECT_NE(corruption.first, "");
}

TEST(Evt2, KnowsNoBoundsWhereItKnowsNoSize) {
  const auto [decoded, corruption] =
      read(EvtFormat::evt2, words32({0x80000000, 0x10000000 | 0x3fffff}), {});
  EXPECT_EQ(decoded.events, events({AbsoluteEvent::at(2047, 2047, 0, on)}));
}

// EVT2.1.

TEST(Evt21, ReadsVectorsInBothOrders) {
  const std::uint32_t upper[] = {0x80000001, 0x10000000 | 2 << 22 | 32 << 11 | 9,
                                 0xa0000000 | 3 << 22 | 1, 0xe0000000,
                                 0x00000000 | 4 << 22 | 620 << 11 | 9};
  const std::uint32_t lower[] = {0, 0x80000005, 0, 0, 0x80080000 | 1};
  Bytes little;
  Bytes legacy;
  for (int i = 0; i < 5; ++i) {
    const auto add = [](Bytes& bytes, std::uint32_t first, std::uint32_t second) {
      const auto word = words32({first, second});
      bytes.insert(bytes.end(), word.begin(), word.end());
    };
    add(little, lower[i], upper[i]);
    add(legacy, upper[i], lower[i]);
  }
  for (const auto& [format, bytes] :
       {std::pair(EvtFormat::evt21, little), std::pair(EvtFormat::evt21_legacy, legacy)}) {
    const auto [decoded, corruption] = read(format, bytes);
    EXPECT_EQ(decoded.events,
              events({AbsoluteEvent::at(32, 9, 66, on), AbsoluteEvent::at(34, 9, 66, on),
                      AbsoluteEvent::at(63, 9, 66, on), AbsoluteEvent::at(620, 9, 68, off),
                      AbsoluteEvent::at(639, 9, 68, off)}));
    EXPECT_EQ(decoded.triggers, (std::vector<Trigger>{{67, 0, true}}));
    EXPECT_EQ(corruption.outside, 1U);  // x = 651
    EXPECT_EQ(corruption.places, 0U);
  }
}

// EVT3.

TEST(Evt3, ReadsEventsVectorsAndTriggers) {
  const auto [decoded, corruption] =
      read(EvtFormat::evt3, evt3({0x2001,                          // before any time and row
                                  0x8001, 0x6002, 0x0005, 0x2803,  // ON at (3, 5), 4098 us
                                  0x3010, 0x4003, 0x4800, 0x5081,  // OFF from x = 16 on
                                  0x8001,                          // the same again
                                  0x2004,                          //
                                  0xa301,                          // rising trigger on input 3
                                  0xe015, 0xf000, 0xf000, 0x7016,  // others
                                  0x8002, 0x2005}));               // time restarts at 8192 us
  EXPECT_EQ(decoded.events,
            events({AbsoluteEvent::at(3, 5, 4098, on), AbsoluteEvent::at(16, 5, 4098, off),
                    AbsoluteEvent::at(17, 5, 4098, off), AbsoluteEvent::at(39, 5, 4098, off),
                    AbsoluteEvent::at(40, 5, 4098, off), AbsoluteEvent::at(47, 5, 4098, off),
                    AbsoluteEvent::at(4, 5, 4098, off), AbsoluteEvent::at(5, 5, 8192, off)}));
  EXPECT_EQ(decoded.triggers, (std::vector<Trigger>{{4098, 3, true}}));
  EXPECT_EQ(corruption.places, 0U);
}

TEST(Evt3, ReadsVectorsThatAreNoTriplets) {
  const auto [decoded, corruption] =
      read(EvtFormat::evt3, evt3({0x8000, 0x6000, 0x0000, 0x3800, 0x5001, 0x5001, 0x4001}));
  EXPECT_EQ(decoded.events, events({AbsoluteEvent::at(0, 0, 0, on), AbsoluteEvent::at(8, 0, 0, on),
                                    AbsoluteEvent::at(16, 0, 0, on)}));
}

TEST(Evt3, PassesOverThePaddingOfLucid) {
  const auto [decoded, corruption] =
      read(EvtFormat::evt3, evt3({0x9999, 0x8000, 0x9999, 0x6000, 0x0000, 0x9999, 0x9999, 0x3800,
                                  0x4001, 0x9999, 0x4001, 0x9999, 0x5001, 0x2805, 0x9999, 0x2806}));
  EXPECT_EQ(decoded.events, events({AbsoluteEvent::at(0, 0, 0, on), AbsoluteEvent::at(12, 0, 0, on),
                                    AbsoluteEvent::at(24, 0, 0, on), AbsoluteEvent::at(5, 0, 0, on),
                                    AbsoluteEvent::at(6, 0, 0, on)}));
  EXPECT_EQ(corruption.places, 0U);
  EXPECT_EQ(read(EvtFormat::evt3, evt3({0x8000, 0x6000, 0x0000, 0x9998})).corruption.places, 1U);
}

TEST(Evt3, PassesOverWhatIsNoChange) {
  // After EM_ADDR_Y, events are not contrast changes until the next row.
  const auto [decoded, corruption] =
      read(EvtFormat::evt3,
           evt3({0x8000, 0x6000, 0x0000, 0x1001, 0x2001, 0x3001, 0x4fff, 0x0002, 0x2003}));
  EXPECT_EQ(decoded.events, events({AbsoluteEvent::at(3, 2, 0, off)}));
  EXPECT_EQ(corruption.places + corruption.outside, 0U);
}

TEST(Evt3, FollowsTheWrapOf24BitsAndAFlippedBit) {
  const auto [decoded, corruption] =
      read(EvtFormat::evt3,
           evt3({0x8ffe, 0x6000, 0x0000, 0x2000, 0x8fff, 0x6000, 0x2000, 0x8000, 0x6000, 0x2000,
                 0x8064, 0x6000, 0x2000, 0x8864, 0x6000, 0x2000, 0x8065, 0x6000, 0x2000}));
  constexpr Microseconds lap = 1 << 24;
  EXPECT_EQ(
      decoded.events,
      events({AbsoluteEvent::at(0, 0, lap - 8192, off), AbsoluteEvent::at(0, 0, lap - 4096, off),
              AbsoluteEvent::at(0, 0, lap, off), AbsoluteEvent::at(0, 0, lap + 0x64000, off),
              AbsoluteEvent::at(0, 0, lap + 0x864000, off),
              AbsoluteEvent::at(0, 0, lap + 0x65000, off)}));
}

TEST(Evt3, FollowsStepsOfFourSeconds) {
  const auto [decoded, corruption] =
      read(EvtFormat::evt3, evt3({0x8dac, 0x6000, 0x0000, 0x2000, 0x81ac, 0x6000, 0x2000}));
  constexpr Microseconds first = 0xdac * 4096;
  EXPECT_EQ(decoded.events, events({AbsoluteEvent::at(0, 0, first, off),
                                    AbsoluteEvent::at(0, 0, first + 1024 * 4096, off)}));
  EXPECT_EQ(corruption.places, 0U);
}

TEST(Evt3, FollowsPausesAcrossTheWrapUpToHalfItsRange) {
  for (const int pause : {1025, 1500, 2047, 2048}) {
    const auto count = static_cast<std::uint16_t>(0x8000 | ((0xffe + pause) & 0xfff));
    const auto next = static_cast<std::uint16_t>(count + 1);
    const auto [decoded, corruption] =
        read(EvtFormat::evt3, evt3({0x8ffe, 0x6000, 0x0000, 0x2000, count, 0x6000, 0x2000, count,
                                    0x2000, next, 0x6000, 0x2000}));
    constexpr Microseconds first = 0xffe * 4096;
    const auto last = first + Microseconds{4096} * pause;
    EXPECT_EQ(
        decoded.events,
        events({AbsoluteEvent::at(0, 0, first, off), AbsoluteEvent::at(0, 0, last, off),
                AbsoluteEvent::at(0, 0, last, off), AbsoluteEvent::at(0, 0, last + 4096, off)}));
    EXPECT_EQ(corruption.places, 0U);
  }
}

/// At a seek point, too. A bit that falls back by half the range or more looks like a pause.
TEST(Evt3, ComesBackFromAFlippedBitAcrossTheWrap) {
  constexpr Microseconds lap = 1 << 24;
  // After 0xffe: 0x003, and 0xffe again.
  for (const std::uint16_t flipped : {0x8403, 0x87fe}) {
    Bytes bytes = evt3({0x8ffe, 0x6000, 0x0000});
    for (int i = 0; i < 1 << 15; ++i) std::ranges::copy(evt3({0x2001}), std::back_inserter(bytes));
    const auto middle = bytes.size() + 2;
    const std::uint16_t next = flipped == 0x8403 ? 0x8004 : 0x8fff;
    std::ranges::copy(evt3({flipped, 0x6000, 0x2002, next, 0x6000, 0x2003}),
                      std::back_inserter(bytes));
    const auto back = next == 0x8004 ? lap + 4 * 4096 : lap - 4096;
    const auto decoder = make_evt_decoder(EvtFormat::evt3, vga);
    const auto decoded = decode(*decoder, bytes, [&] { return middle; });
    ASSERT_EQ(decoded.events.size(), (1U << 15) + 2);
    EXPECT_EQ(decoded.events.back(), AbsoluteEvent::at(3, 0, back, off));
    EXPECT_EQ(decoder->corruption().places, 1U);
    const auto seek_point = decoder->seek_point_before(100 * lap);
    ASSERT_TRUE(seek_point);
    ASSERT_EQ(seek_point->position, middle);
    decoder->restart(*seek_point);
    const auto again = decode(*decoder, std::span(bytes).subspan(middle));
    ASSERT_EQ(again.events.size(), 2U);
    EXPECT_EQ(again.events.back(), decoded.events.back());
  }
}

/// No trigger of a sought time or later is missing.
TEST(Triggers, HaveSeekPointsWithoutEvents) {
  for (const auto format : {EvtFormat::evt3, EvtFormat::evt2, EvtFormat::evt21, EvtFormat::evt4}) {
    const auto encoder = make_evt_encoder(format, vga);
    Bytes bytes;
    encoder->encode(events({AbsoluteEvent::at(1, 2, 5, on)}), bytes);
    for (Microseconds t = 100; t < 4'000'000; t += 20) encoder->encode_trigger({t, 1, true}, bytes);
    const auto decoder = make_evt_decoder(format, vga);
    decode(*decoder, bytes);
    for (Microseconds t = 1000; t < 4'000'000; t += 400'000) {
      const auto seek_point = decoder->seek_point_before(t);
      ASSERT_TRUE(seek_point);
      decoder->restart(*seek_point);
      const auto decoded = decode(*decoder, std::span(bytes).subspan(seek_point->position));
      ASSERT_FALSE(decoded.triggers.empty()) << t;
      EXPECT_LE(decoded.triggers.front().t, t);
      EXPECT_TRUE(t < 1'000'000 || seek_point->position > 0U);
    }
  }
}

TEST(Evt3, DropsWhatIsOutside) {
  const auto [decoded, corruption] =
      read(EvtFormat::evt3, evt3({0x8000, 0x6000, 0x0000, 0x2000 + 640, 0x3000 + 638, 0x4fff,
                                  0x4fff, 480, 0x2000, 0x3000, 0x5003}));
  EXPECT_EQ(decoded.events,
            events({AbsoluteEvent::at(638, 0, 0, off), AbsoluteEvent::at(639, 0, 0, off)}));
  EXPECT_EQ(corruption.outside, 1U + 22U + 1U + 2U);
}

TEST(Evt3, NotesWhatIsNoWord) {
  const auto [decoded, corruption] =
      read(EvtFormat::evt3, evt3({0x8000, 0x6000, 0x0000, 0x4001, 0x9000, 0xb000, 0x2000, 0xc000}));
  EXPECT_EQ(decoded.events.size(), 1U);
  EXPECT_EQ(corruption.places, 2U);
  EXPECT_EQ(corruption.first_at, 6U);
}

TEST(Evt3, DoesNotRunOutOfTheSensorByVectors) {
  Bytes bytes = evt3({0x8000, 0x6000, 0x0000, 0x3000});
  for (int i = 0; i < 200'000; ++i) {
    bytes.push_back(0xff);
    bytes.push_back(0x4f);
  }
  const auto [decoded, corruption] = read(EvtFormat::evt3, bytes);
  EXPECT_EQ(decoded.events.size(), 640U);
  EXPECT_EQ(corruption.outside, 200'000U * 12 - 640);
}

// EVT4.

TEST(Evt4, ReadsEventsVectorsAndTriggers) {
  const auto [decoded, corruption] =
      read(EvtFormat::evt4,
           words32({0xb0000000, 0xc0000000, 0xe0000009,  // before any time; a mask of one
                    0xe0000001, 0xa0000000 | 1 << 22 | 3 << 11 | 4,  //
                    0xd0000000 | 2 << 22 | 32 << 11 | 5, 0x80000001, 0xffffffff,
                    0x90000000 | 3 << 22 | 2 << 8 | 1, 0x60000000, 0x70000000,
                    0xc0000000 | 4 << 22 | 608 << 11 | 5, 0xe0000000}));
  EXPECT_EQ(decoded.events,
            events({AbsoluteEvent::at(3, 4, 65, off), AbsoluteEvent::at(32, 5, 66, on),
                    AbsoluteEvent::at(63, 5, 66, on), AbsoluteEvent::at(637, 5, 68, off),
                    AbsoluteEvent::at(638, 5, 68, off), AbsoluteEvent::at(639, 5, 68, off)}));
  EXPECT_EQ(decoded.triggers, (std::vector<Trigger>{{67, 2, true}}));
  EXPECT_EQ(corruption.places + corruption.outside, 0U);
}

TEST(Evt4, NotesAVectorThatTheFileCuts) {
  const auto [decoded, corruption] = read(EvtFormat::evt4, words32({0xe0000000, 0xc0000000}));
  EXPECT_TRUE(decoded.events.empty());
  EXPECT_EQ(corruption.places, 1U);
  EXPECT_EQ(corruption.first_at, 4U);
}

}  // namespace
