// SPDX-License-Identifier: LGPL-2.1-or-later
// Prophesee RAW files and their words: encoding word by word, and decoding of hand-made words.
#include <gtest/gtest.h>

#include <cstring>
#include <stdexcept>

#include "src/formats/evt/raw.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace recordings;

constexpr SensorSize vga{640, 480};

template <class Word>
Bytes bytes_of_words(std::initializer_list<Word> words) {
  Bytes bytes(words.size() * sizeof(Word));
  std::memcpy(bytes.data(), words.begin(), bytes.size());
  return bytes;
}

Bytes evt3(std::initializer_list<std::uint16_t> words) {
  return bytes_of_words(words);
}

Bytes words32(std::initializer_list<std::uint32_t> words) {
  return bytes_of_words(words);
}

AbsoluteEvent on(int x, int y, Microseconds t) {
  return AbsoluteEvent::at(x, y, t, Polarity::on);
}

AbsoluteEvent off(int x, int y, Microseconds t) {
  return AbsoluteEvent::at(x, y, t, Polarity::off);
}

Events read(EvtFormat format, const Bytes& bytes, SensorSize size = vga) {
  return decode(*make_evt_decoder(format, size), bytes).events;
}

// Encoding.

TEST(Written, KeepsTimeAliveThroughSilence) {
  const Events events{on(1, 2, 5), on(1, 2, 3'000'005)};
  const auto evt4 = encode(*make_evt_encoder(EvtFormat::evt4, vga), events);
  // One step per 960 us, and the two events.
  EXPECT_EQ(evt4.size() / 4, 1U + 3'000'000 / 960 + 2U);
  EXPECT_EQ(read(EvtFormat::evt4, evt4), events);
  // One step per 4096 us, and 2 more words at the second event.
  EXPECT_EQ(encode(*make_evt_encoder(EvtFormat::evt3, vga), events).size() / 2,
            4U + 3'000'005 / 4096 + 2U);
}

TEST(Written, Evt4IsBelievedAfterEveryWrap) {
  constexpr auto lap = Microseconds{1} << 34;
  for (const auto start : {lap, 2 * lap}) {
    const Events events{on(1, 2, start - 700), off(3, 4, start + 700)};
    const auto bytes = encode(*make_evt_encoder(EvtFormat::evt4, vga), events);
    EXPECT_LT(bytes.size(), 100U);
    EXPECT_EQ(read(EvtFormat::evt4, bytes), events);
  }
}

TEST(Written, Evt4HasNoVectorPastTheSensor) {
  Events row;
  for (int x = 0; x < 351; ++x) row.push_back(on(x, 7, 9));
  const auto bytes = encode(*make_evt_encoder(EvtFormat::evt4, {351, 260}), row);
  // Ten vectors, and 31 events.
  EXPECT_EQ(bytes.size() / 4, 1U + 10 * 2U + 31U);
  EXPECT_EQ(read(EvtFormat::evt4, bytes, {351, 260}), row);
}

TEST(Written, Evt3GroupsWhatPays) {
  Events row;
  for (int x = 100; x < 104; ++x) row.push_back(on(x, 7, 9));
  const auto written = [&] { return encode(*make_evt_encoder(EvtFormat::evt3, vga), row); };
  EXPECT_EQ(written(), evt3({0x8000, 0x6009, 0x0007, 0x2864, 0x2865, 0x2866, 0x2867}));
  row.push_back(on(131, 7, 9));
  EXPECT_EQ(written(), evt3({0x8000, 0x6009, 0x0007, 0x3864, 0x400f, 0x4000, 0x5080}));
  row.push_back(on(132, 7, 9));
  EXPECT_EQ(written(), evt3({0x8000, 0x6009, 0x0007, 0x3864, 0x400f, 0x4000, 0x5080, 0x2884}));
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
    EXPECT_EQ(decode(*make_evt_decoder(format, vga), bytes).triggers,
              (std::vector<Trigger>{{5, last, true}}));
  }
}

TEST(Written, HeadersTellTheFormatToAnyReader) {
  for (const auto& [format, line] :
       {std::pair{EvtFormat::evt2, "% evt 2.0\n% format EVT2;"},
        {EvtFormat::evt21, "% evt 2.1\n% format EVT21;endianness=little;"},
        {EvtFormat::evt21_legacy, "% evt 2.1\n% format EVT21;endianness=legacy;"},
        {EvtFormat::evt3, "% evt 3.0\n% format EVT3;"},
        {EvtFormat::evt4, "% evt 4.0\n% format EVT4;"}}) {
    const auto bytes = encode(*make_prophesee_raw_encoder(format, {1280, 720}), {});
    const std::string text(bytes.begin(), bytes.end());
    EXPECT_NE(text.find(line), std::string::npos) << text;
    EXPECT_NE(text.find("\n% geometry 1280x720\n"), std::string::npos) << text;
  }
}

TEST(Written, IsForSensorsThatTheWordsCanAddress) {
  EXPECT_THROW(make_prophesee_raw_encoder(EvtFormat::evt3, {2049, 1}), std::invalid_argument);
  EXPECT_THROW(make_evt_encoder(EvtFormat::evt2, {1, 0}), std::invalid_argument);
}

// Headers.

Bytes file_of(const std::string& header, const Bytes& words) {
  auto bytes = bytes_of(header);
  bytes.insert(bytes.end(), words.begin(), words.end());
  return bytes;
}

/// Expects this size and an event, however the bytes come.
void expect_evt2(const std::string& header, SensorSize size) {
  const auto file = file_of(header, words32({0x80000000, 0x10000000 | 1 << 22 | 3 << 11 | 2}));
  for (const std::size_t piece : {std::size_t{1}, file.size()}) {
    const auto decoder = make_prophesee_raw_decoder();
    EXPECT_EQ(decode(*decoder, file, piece).events, Events{on(3, 2, 1)}) << header;
    EXPECT_EQ(decoder->size(), size);
    EXPECT_EQ(decoder->corruption().places, 0U);
  }
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
  const auto file = file_of("% evt 2.0\n", words32({0x2025, 0x80000000, 0x10000000 | 3 << 11}));
  EXPECT_EQ(decode(*make_prophesee_raw_decoder(), file).events, Events{on(3, 0, 0)});
}

TEST(RawHeader, TellsTheOrderOfEvt21) {
  const auto little = words32({0, 0x80000000, 1, 0x10000000});
  const auto legacy = words32({0x80000000, 0, 0x10000000, 1});
  for (const auto& [header, words] :
       {std::pair{"% format EVT21;height=480;width=640\n% end\n", little},
        {"% format EVT21;endianness=little;height=480;width=640\n% end\n", little},
        {"% format EVT21;endianness=legacy;height=480;width=640\n% end\n", legacy},
        {"% format EVT21;height=480;width=640;endianness=legacy\n% end\n", legacy},
        {"% endianness legacy\n% format EVT21;height=480;width=640\n% end\n", legacy},
        {"% evt 2.1\n% system_ID 49\n% end\n", legacy},
        {"% evt 2.1\n% geometry 320x320\n% system_ID 49\n% end\n", little}})
    EXPECT_EQ(decode(*make_prophesee_raw_decoder(), file_of(header, words)).events,
              Events{on(0, 0, 0)})
        << header;
}

TEST(RawHeader, IsAnErrorThatSaysWhy) {
  const auto error = [](const std::string& file) {
    return refusal(*make_prophesee_raw_decoder(), bytes_of(file));
  };
  std::string endless;
  while (endless.size() < 1'000'000) endless += "% a b\n";
  for (const auto& file :
       {std::string(), std::string("%"), std::string("GIF89a"), std::string("%PDF-1.4\n"),
        std::string(1000, '\0'), std::string("% evt 9.9\n% end\n"), endless,
        "% " + std::string(1'000'000, 'x')})
    EXPECT_NE(error(file), "") << file.substr(0, 20);
  EXPECT_NE(error("% date 1\n% end\n").find("format"), std::string::npos);
  EXPECT_NE(error("% format HISTO3D;height=1;width=1\n% end\n").find("HISTO3D"), std::string::npos);
  EXPECT_NE(error("% format EVT21;endianness=big\n% end\n").find("big"), std::string::npos);
}

// Decoding.

/// Words, and what is read from them.
struct Words {
  const char* name;
  EvtFormat format;
  Bytes bytes;
  Events events = {};
  std::vector<Trigger> triggers = {};
  struct {
    std::uint64_t places, first_at, outside;
  } corruption = {};
};

constexpr Microseconds lap34 = Microseconds{1} << 34;
constexpr Microseconds lap24 = 1 << 24;

const Words all_words[] = {
    {"Evt2HasEventsTriggersAndOthers",
     EvtFormat::evt2,
     words32({0x10000000 | 1 << 11,                    // before any time
              0x80000002,                              // 128 us
              0x00000000 | 5 << 22 | 639 << 11 | 479,  //
              0xe0000000, 0xf0000001, 0xd0000000,      // others, continued, IMU
              0xa0000000 | 6 << 22 | 1 << 8 | 1,       // rising trigger on input 1
              0xa0000000 | 7 << 22 | 1 << 8,           // falling edge
              0x10000000 | 63U << 22}),
     {off(639, 479, 133), on(0, 0, 191)},
     {{134, 1, true}, {135, 1, false}}},
    {"Evt2WrapsAfter34Bits",
     EvtFormat::evt2,
     words32({0x8fffffff, 0x10000000 | 63U << 22, 0x80000000, 0x10000000, 0x8fffffff, 0x8fffffff,
              0x80000000, 0x10000000}),
     {on(0, 0, lap34 - 1), on(0, 0, lap34), on(0, 0, 2 * lap34)}},
    {"Evt2KeepsDisorderAndCountsWhatIsOutside",
     EvtFormat::evt2,
     words32({0x80000064, 0x10000000, 0x80000063, 0x10000000 | 1 << 11, 0x80000065, 0x10000000,
              0x10000000 | 640 << 11, 0x10000000 | 480}),
     {on(0, 0, 6400), on(1, 0, 6336), on(0, 0, 6464)},
     {},
     {1, 8, 2}},
    {"Evt2CountsBrokenWordsByPlaces",
     EvtFormat::evt2,
     words32({0x80000000, 0x10000000, 0x20000000, 0x30000000, 0x10000000, 0x90000000, 0x10000000}),
     {on(0, 0, 0), on(0, 0, 0), on(0, 0, 0)},
     {},
     {2, 8, 0}},
    {"Evt3HasEventsVectorsAndTriggers",
     EvtFormat::evt3,
     evt3({0x2001,                          // before any time and row
           0x8001, 0x6002, 0x0005, 0x2803,  // ON at (3, 5), 4098 us
           0x3010, 0x4003, 0x4800, 0x5081,  // OFF from x = 16 on
           0x8001,                          // the same again
           0x2004,                          //
           0xa301,                          // rising trigger on input 3
           0xe015, 0xf000, 0xf000, 0x7016,  // others
           0x8002, 0x2005}),                // time restarts at 8192 us
     {on(3, 5, 4098), off(16, 5, 4098), off(17, 5, 4098), off(39, 5, 4098), off(40, 5, 4098),
      off(47, 5, 4098), off(4, 5, 4098), off(5, 5, 8192)},
     {{4098, 3, true}}},
    {"Evt3HasVectorsThatAreNoTriplets",
     EvtFormat::evt3,
     evt3({0x8000, 0x6000, 0x0000, 0x3800, 0x5001, 0x5001, 0x4001}),
     {on(0, 0, 0), on(8, 0, 0), on(16, 0, 0)}},
    {"Evt3HasThePaddingOfLucid",
     EvtFormat::evt3,
     evt3({0x9999, 0x8000, 0x9999, 0x6000, 0x0000, 0x9999, 0x9999, 0x3800, 0x4001, 0x9999, 0x4001,
           0x9999, 0x5001, 0x2805, 0x9999, 0x2806}),
     {on(0, 0, 0), on(12, 0, 0), on(24, 0, 0), on(5, 0, 0), on(6, 0, 0)}},
    {"Evt3HasNoOtherPadding",
     EvtFormat::evt3,
     evt3({0x8000, 0x6000, 0x0000, 0x9998}),
     {},
     {},
     {1, 6, 0}},
    // After EM_ADDR_Y, events are not contrast changes until the next row.
    {"Evt3HasEventsThatAreNoChanges",
     EvtFormat::evt3,
     evt3({0x8000, 0x6000, 0x0000, 0x1001, 0x2001, 0x3001, 0x4fff, 0x0002, 0x2003}),
     {off(3, 2, 0)}},
    {"Evt3WrapsAfter24Bits",
     EvtFormat::evt3,
     evt3({0x8ffe, 0x6000, 0x0000, 0x2000, 0x8fff, 0x6000, 0x2000, 0x8000, 0x6000, 0x2000}),
     {off(0, 0, lap24 - 8192), off(0, 0, lap24 - 4096), off(0, 0, lap24)}},
    {"Evt3FollowsStepsOfFourSeconds",
     EvtFormat::evt3,
     evt3({0x8dac, 0x6000, 0x0000, 0x2000, 0x81ac, 0x6000, 0x2000}),
     {off(0, 0, 0xdac * 4096), off(0, 0, (0xdac + 1024) * 4096)}},
    {"Evt3DropsWhatIsOutside",
     EvtFormat::evt3,
     evt3({0x8000, 0x6000, 0x0000, 0x2000 + 640, 0x3000 + 638, 0x4fff, 0x4fff, 480, 0x2000, 0x3000,
           0x5003}),
     {off(638, 0, 0), off(639, 0, 0)},
     {},
     {0, 0, 1 + 22 + 1 + 2}},
    {"Evt3NotesWhatIsNoWord",
     EvtFormat::evt3,
     evt3({0x8000, 0x6000, 0x0000, 0x4001, 0x9000, 0xb000, 0x2000, 0xc000}),
     {off(0, 0, 0)},
     {},
     {2, 6, 0}},
    {"Evt4HasEventsVectorsAndTriggers",
     EvtFormat::evt4,
     words32({0xb0000000, 0xc0000000, 0xe0000009,              // before any time; a mask of one
              0xe0000001, 0xa0000000 | 1 << 22 | 3 << 11 | 4,  //
              0xd0000000 | 2 << 22 | 32 << 11 | 5, 0x80000001, 0xffffffff,  //
              0x90000000 | 3 << 22 | 2 << 8 | 1, 0x60000000, 0x70000000,    //
              0xc0000000 | 4 << 22 | 608 << 11 | 5, 0xe0000000}),
     {off(3, 4, 65), on(32, 5, 66), on(63, 5, 66), off(637, 5, 68), off(638, 5, 68),
      off(639, 5, 68)},
     {{67, 2, true}}},
    {"Evt4NotesAVectorThatTheFileCuts",
     EvtFormat::evt4,
     words32({0xe0000000, 0xc0000000}),
     {},
     {},
     {1, 4, 0}},
};

class ReadWords : public testing::TestWithParam<Words> {};
INSTANTIATE_TEST_SUITE_P(, ReadWords, testing::ValuesIn(all_words),
                         [](const auto& test) { return test.param.name; });

TEST_P(ReadWords, AreRead) {
  const auto decoder = make_evt_decoder(GetParam().format, vga);
  const auto decoded = decode(*decoder, GetParam().bytes);
  EXPECT_EQ(decoded.events, GetParam().events);
  EXPECT_EQ(decoded.triggers, GetParam().triggers);
  EXPECT_EQ(decoder->corruption().places, GetParam().corruption.places);
  EXPECT_EQ(decoder->corruption().first_at, GetParam().corruption.first_at);
  EXPECT_EQ(decoder->corruption().outside, GetParam().corruption.outside);
}

TEST(Evt2, KnowsNoBoundsWhereItKnowsNoSize) {
  EXPECT_EQ(read(EvtFormat::evt2, words32({0x80000000, 0x10000000 | 0x3fffff}), {}),
            Events{on(2047, 2047, 0)});
}

TEST(Evt21, HasVectorsInBothOrders) {
  const std::uint32_t upper[] = {0x80000001, 0x10000000 | 2 << 22 | 32 << 11 | 9,
                                 0xa0000000 | 3 << 22 | 1, 0xe0000000,
                                 0x00000000 | 4 << 22 | 620 << 11 | 9};
  const std::uint32_t lower[] = {0, 0x80000005, 0, 0, 0x80080000 | 1};
  for (const auto format : {EvtFormat::evt21, EvtFormat::evt21_legacy}) {
    Bytes bytes;
    for (std::size_t i = 0; i < std::size(upper); ++i) {
      const bool is_legacy = format == EvtFormat::evt21_legacy;
      std::ranges::copy(is_legacy ? words32({upper[i], lower[i]}) : words32({lower[i], upper[i]}),
                        std::back_inserter(bytes));
    }
    const auto decoder = make_evt_decoder(format, vga);
    const auto decoded = decode(*decoder, bytes);
    EXPECT_EQ(decoded.events, (Events{on(32, 9, 66), on(34, 9, 66), on(63, 9, 66), off(620, 9, 68),
                                      off(639, 9, 68)}));
    EXPECT_EQ(decoded.triggers, (std::vector<Trigger>{{67, 0, true}}));
    EXPECT_EQ(decoder->corruption().outside, 1U);  // x = 651
    EXPECT_EQ(decoder->corruption().places, 0U);
  }
}

TEST(Evt3, FollowsPausesAcrossTheWrapUpToHalfItsRange) {
  for (const int pause : {1025, 1500, 2047, 2048}) {
    const auto count = static_cast<std::uint16_t>(0x8000 | ((0xffe + pause) & 0xfff));
    const auto next = static_cast<std::uint16_t>(count + 1);
    constexpr Microseconds first = 0xffe * 4096;
    const auto last = first + Microseconds{4096} * pause;
    EXPECT_EQ(read(EvtFormat::evt3, evt3({0x8ffe, 0x6000, 0x0000, 0x2000, count, 0x6000, 0x2000,
                                          count, 0x2000, next, 0x6000, 0x2000})),
              (Events{off(0, 0, first), off(0, 0, last), off(0, 0, last), off(0, 0, last + 4096)}));
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
    // Not by decode(), whose blocks are smaller.
    Decoded decoded;
    decoder->decode(std::span(bytes).first(middle), decoded);
    decoder->decode(std::span(bytes).subspan(middle), decoded);
    decoder->finish(decoded);
    ASSERT_EQ(decoded.events.size(), (1U << 15) + 2);
    EXPECT_EQ(decoded.events.back(), off(3, 0, back));
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
    encoder->encode(Events{on(1, 2, 5)}, bytes);
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

TEST(Evt3, DoesNotRunOutOfTheSensorByVectors) {
  Bytes bytes = evt3({0x8000, 0x6000, 0x0000, 0x3000});
  for (int i = 0; i < 200'000; ++i) bytes.insert(bytes.end(), {0xff, 0x4f});
  const auto decoder = make_evt_decoder(EvtFormat::evt3, vga);
  EXPECT_EQ(decode(*decoder, bytes).events.size(), 640U);
  EXPECT_EQ(decoder->corruption().outside, 200'000U * 12 - 640);
}

}  // namespace
