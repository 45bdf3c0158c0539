// SPDX-License-Identifier: LGPL-2.1-or-later
// N-MNIST, DAT and Event Stream files, made byte by byte.
#include <gtest/gtest.h>

#include "src/formats/atis/atis_bin.hpp"
#include "src/formats/dat/dat.hpp"
#include "src/formats/es/es.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using recordings::Bytes;
using recordings::decode;
using recordings::Events;
using Times = std::vector<Microseconds>;

constexpr SensorSize n_mnist{34, 34};

TEST(AtisBin, ReadsEventsOfFortyBits) {
  const auto decoder = make_atis_bin_decoder({});
  const auto decoded = decode(*decoder, Bytes{
                                            10, 30, 0x00, 0x03, 0xb7,   // OFF at 951 us
                                            0, 0, 0x81, 0x00, 0x00,     // ON at 65536 us
                                            255, 239, 0x7f, 0xff, 0xff  // the last time
                                        });
  EXPECT_EQ(decoded.events, (std::vector{AbsoluteEvent::at(10, 30, 951, Polarity::off),
                                         AbsoluteEvent::at(0, 0, 65536, Polarity::on),
                                         AbsoluteEvent::at(255, 239, 0x7fffff, Polarity::off)}));
  EXPECT_EQ(decoder->size(), SensorSize{});
}

TEST(AtisBin, AddsOverflowsAndWraps) {
  const auto decoder = make_atis_bin_decoder(n_mnist);
  const auto decoded = decode(*decoder, Bytes{1, 2,   0x80, 0,    1,     //
                                              0, 240, 0,    0,    0,     // an overflow
                                              1, 2,   0x80, 0,    2,     //
                                              1, 2,   0xff, 0xff, 0xff,  //
                                              1, 2,   0x80, 0,    2,     // a wrap
                                              1, 2,   0xff, 0xff, 0xfe,  // from before it
                                              0, 240, 0,    0,    0,     // an overflow
                                              1, 2,   0x80, 0,    3});
  constexpr Microseconds overflow = 8192;
  Times times;
  for (const auto& event : decoded.events) times.push_back(event.t);
  EXPECT_EQ(times, (Times{1, overflow + 2, overflow + 0x7fffff, overflow + 0x800002,
                          overflow + 0x7ffffe, 2 * overflow + 0x800003}));
}

TEST(AtisBin, CountsEventsOutsideTheSensorAndATruncatedOne) {
  const auto decoder = make_atis_bin_decoder(n_mnist);
  const auto decoded =
      decode(*decoder, Bytes{34, 0, 0x80, 0, 1, 0, 34, 0, 0, 1, 0, 0, 0, 0, 2, 9, 9});
  EXPECT_EQ(decoded.events, (std::vector{AbsoluteEvent::at(0, 0, 2, Polarity::off)}));
  EXPECT_EQ(decoder->corruption().outside, 2U);
  EXPECT_EQ(decoder->corruption().places, 1U);
}

struct Record {
  std::uint32_t t;
  std::uint32_t place;
};

Bytes dat_file(const std::string& header, std::uint8_t type, std::initializer_list<Record> records,
               std::uint8_t size = 8) {
  auto bytes = recordings::bytes_of(header);
  bytes.push_back(type);
  bytes.push_back(size);
  for (const auto& record : records)
    for (const auto word : {record.t, record.place})
      for (int i = 0; i < 32; i += 8) bytes.push_back(static_cast<std::uint8_t>(word >> i));
  return bytes;
}

const std::string version_2 = "% Version 2\n% Height 240\n% Width 304\n";

TEST(Dat, ReadsVersion2) {
  const auto decoder = make_dat_decoder();
  const auto decoded = decode(
      *decoder,
      dat_file("% Data file containing CD events.\n% Version 2\n% Date 2017-3-1 9:30:00\n"
               "% Height 720\n% Width 1280\n",
               0x0c, {{5, 1279 | 719U << 14 | 1U << 28}, {6, 0}, {6, 1280}, {6, 720U << 14}}));
  EXPECT_EQ(decoded.events, (std::vector{AbsoluteEvent::at(1279, 719, 5, Polarity::on),
                                         AbsoluteEvent::at(0, 0, 6, Polarity::off)}));
  EXPECT_EQ(decoder->size(), (SensorSize{1280, 720}));
  EXPECT_EQ(decoder->corruption().outside, 2U);
  EXPECT_EQ(decoder->corruption().places, 0U);
}

TEST(Dat, ReadsVersion1) {
  for (const std::string header : {"% Version 1\n", "% Data file\n% end\n"}) {
    const auto decoder = make_dat_decoder();
    const auto decoded =
        decode(*decoder, dat_file(header, 0x00, {{5, 303 | 239U << 9 | 1U << 17}, {6, 7U << 18}}));
    EXPECT_EQ(decoded.events, (std::vector{AbsoluteEvent::at(303, 239, 5, Polarity::on),
                                           AbsoluteEvent::at(0, 0, 6, Polarity::off)}));
    EXPECT_EQ(decoder->size(), (SensorSize{304, 240}));
  }
}

TEST(Dat, ReadsTriggers) {
  const auto decoder = make_dat_decoder();
  const auto decoded =
      decode(*decoder, dat_file("% Version 2\n% end\n", 0x0e, {{5, 6U << 26 | 1}, {9, 6U << 26}}));
  EXPECT_EQ(decoded.triggers, (std::vector<Trigger>{{5, 6, true}, {9, 6, false}}));
  EXPECT_TRUE(decoded.events.empty());
}

TEST(Dat, FollowsWrapsAndKeepsDisorder) {
  const auto times_of = [](std::initializer_list<Record> records) {
    Times times;
    for (const auto& event : decode(*make_dat_decoder(), dat_file(version_2, 0x0c, records)).events)
      times.push_back(event.t);
    return times;
  };
  constexpr auto lap = Microseconds{1} << 32;
  EXPECT_EQ(times_of({{0xfffffff0, 0}, {3, 0}, {2, 0}, {0xf0000000, 0}, {1, 0}}),
            (Times{0xfffffff0, lap + 3, lap + 2, lap + 0xf0000000, 2 * lap + 1}));
  EXPECT_EQ(times_of({{0xffffffff, 0},
                      {2, 0},
                      {0xfffffffe, 0},
                      {3, 0},
                      {0xffff0000, 0},
                      {0xffff0001, 0},
                      {4, 0}}),
            (Times{lap - 1, lap + 2, lap - 2, lap + 3, lap - 0x10000, lap - 0xffff, lap + 4}));
}

TEST(Dat, IsAnErrorThatSaysWhy) {
  const auto error = [](const Bytes& bytes) {
    return recordings::refusal(*make_dat_decoder(), bytes);
  };
  EXPECT_NE(error({}), "");
  EXPECT_NE(error({'%', ' ', 'a', '\n'}), "");
  EXPECT_NE(error({'R', 'I', 'F', 'F'}), "");
  EXPECT_NE(error(dat_file("% Version 3\n% end\n", 0x0c, {})).find('3'), std::string::npos);
  EXPECT_NE(error(dat_file(version_2, 0x28, {})).find("40"), std::string::npos);
  EXPECT_NE(error(dat_file(version_2, 0x0c, {}, 16)).find("16"), std::string::npos);
}

TEST(Dat, IsWrittenAsTheToolsOfTheVendorDo) {
  const auto encoder = make_dat_encoder({1280, 720});
  const std::vector events{AbsoluteEvent::at(1279, 719, 5, Polarity::on)};
  EXPECT_EQ(recordings::encode(*encoder, events),
            dat_file("% Data file containing CD events.\n% Version 2\n% Height 720\n% Width 1280\n"
                     "% end\n",
                     0x0c, {{5, 1279 | 719U << 14 | 1U << 28}}));
  EXPECT_THROW(make_dat_encoder({16385, 1}), std::invalid_argument);
}

/// The times that are read of those that are written.
Times read_again(std::initializer_list<Microseconds> times, std::uint64_t removed) {
  Events events;
  for (const auto t : times) events.push_back(AbsoluteEvent::at(1, 2, t, Polarity::on));
  const auto encoder = make_dat_encoder({320, 240});
  const auto bytes = recordings::encode(*encoder, events);
  EXPECT_EQ(encoder->removed_time(), removed);
  Times read;
  for (const auto& event : decode(*make_dat_decoder(), bytes).events) read.push_back(event.t);
  return read;
}

TEST(Dat, IsWrittenWithTimesThatItsReadersCanTell) {
  constexpr Microseconds minute = 60'000'000;
  constexpr Microseconds lap = Microseconds{1} << 32;
  EXPECT_EQ(read_again({lap - 1, lap + 5}, 0), (Times{lap - 1, lap + 5}));
  // Times since 1970 begin at 0.
  EXPECT_EQ(read_again({1'790'000'000'000'000, 1'790'000'000'000'007}, 0), (Times{0, 7}));
  EXPECT_EQ(read_again({lap, lap + 7}, 0), (Times{0, 7}));
  // Pauses: with a wrap or without, and longer than one.
  EXPECT_EQ(read_again({0, 70 * minute, 104 * minute}, 0), (Times{0, 70 * minute, 104 * minute}));
  EXPECT_EQ(read_again({60 * minute, 100 * minute, 101 * minute}, 40 * minute),
            (Times{60 * minute, 60 * minute, 61 * minute}));
  EXPECT_EQ(read_again({1, lap - 2, lap + 1}, lap - 3), (Times{1, 1, 4}));
  EXPECT_EQ(read_again({1, lap - 1'000'001, lap + 1}, 0), (Times{1, lap - 1'000'001, lap + 1}));
  EXPECT_EQ(read_again({5, 80 * minute, 80 * minute + 1}, 80 * minute - 5), (Times{5, 5, 6}));
}

Bytes es_file(std::uint8_t type, const Bytes& body, std::uint8_t version = 2) {
  // Of 320x240 pixels.
  Bytes bytes{'E', 'v', 'e',     'n', 't', ' ',  'S',  't',  'r',  'e',
              'a', 'm', version, 0,   0,   type, 0x40, 0x01, 0xf0, 0};
  for (const auto byte : body) bytes.push_back(byte);
  return bytes;
}

TEST(EventStream, ReadsDvsEventsWithRowsFromTheBottom) {
  const auto decoder = make_event_stream_decoder();
  const auto decoded = decode(*decoder, es_file(1, {5 << 1 | 1, 0x3f, 0x01, 0,   0,  //
                                                    0xff,       0xff, 0xfe,          //
                                                    126 << 1,   0,    0,    239, 0,  //
                                                    0,          0x40, 0x01, 0,   0,  //
                                                    0,          0,    0,    240, 0}));
  EXPECT_EQ(decoded.events, (std::vector{AbsoluteEvent::at(319, 239, 5, Polarity::on),
                                         AbsoluteEvent::at(0, 0, 5 + 254 + 126, Polarity::off)}));
  EXPECT_EQ(decoder->size(), (SensorSize{320, 240}));
  EXPECT_EQ(decoder->corruption().outside, 2U);
  EXPECT_EQ(decoder->corruption().places, 0U);
}

TEST(EventStream, ReadsTheChangesAmongAtisEvents) {
  const auto decoder = make_event_stream_decoder();
  const auto decoded =
      decode(*decoder, es_file(2, {5 << 2 | 2,  1,    0,    239, 0,     // ON
                                   1 << 2 | 1,  1,    0,    239, 0,     // an exposure starts
                                   0xfc,        0xfd, 0xff,             // 0, 63 and 189 us
                                   62 << 2 | 3, 1,    0,    239, 0,     // and ends
                                   0,           2,    0,    238, 0}));  // OFF
  EXPECT_EQ(decoded.events,
            (std::vector{AbsoluteEvent::at(1, 0, 5, Polarity::on),
                         AbsoluteEvent::at(2, 1, 5 + 1 + 63 + 189 + 62, Polarity::off)}));
  EXPECT_EQ(decoder->corruption().outside, 0U);
  EXPECT_EQ(decoder->corruption().skipped, 2U);
}

TEST(EventStream, ReadsColourEventsWithoutTheirColours) {
  const auto decoder = make_event_stream_decoder();
  const auto decoded =
      decode(*decoder, es_file(4, {5,    1,    0,    239, 0, 255, 0, 128,        //
                                   0xff, 0xfe, 253,  2,   0, 0,   0, 1,   2, 3,  // 254 us, a reset
                                   0,    0x40, 0x01, 0,   0, 9,   9, 9}));       // outside
  EXPECT_EQ(decoded.events, (std::vector{AbsoluteEvent::at(1, 0, 5, Polarity::on),
                                         AbsoluteEvent::at(2, 239, 5 + 254 + 253, Polarity::on)}));
  EXPECT_EQ(decoder->corruption().skipped, 2U);
  EXPECT_EQ(decoder->corruption().outside, 1U);
}

TEST(EventStream, IsAnErrorThatSaysWhy) {
  const auto error = [](const Bytes& bytes) {
    return recordings::refusal(*make_event_stream_decoder(), bytes);
  };
  EXPECT_NE(error({}), "");
  EXPECT_NE(error({'E', 'v', 'e'}), "");
  EXPECT_NE(error({'E', 'v', 'i'}), "");
  EXPECT_NE(error(es_file(1, {}, 1)).find("1.0"), std::string::npos);
  EXPECT_NE(error(es_file(0, {})).find("Export them"), std::string::npos);
  EXPECT_NE(error(es_file(9, {})).find('9'), std::string::npos);
  auto no_rows = es_file(1, {});
  no_rows[18] = no_rows[19] = 0;
  EXPECT_NE(error(no_rows).find("320 x 0"), std::string::npos);
}

TEST(EventStream, IsWrittenByteByByte) {
  const auto encoder = make_event_stream_encoder({320, 240});
  const std::vector events{AbsoluteEvent::at(319, 239, 5, Polarity::on),
                           AbsoluteEvent::at(0, 0, 5 + 126, Polarity::off),
                           AbsoluteEvent::at(0, 0, 5 + 126 + 127, Polarity::off)};
  EXPECT_EQ(
      recordings::encode(*encoder, events),
      es_file(1, {5 << 1 | 1, 0x3f, 0x01, 0, 0, 126 << 1, 0, 0, 239, 0, 0xff, 0, 0, 0, 239, 0}));
  EXPECT_THROW(make_event_stream_encoder({16385, 1}), std::invalid_argument);
}

TEST(EventStream, LeavesNothingOutOfALongRecordingWithoutPauses) {
  Events events;
  const auto step = Microseconds{11} * 3'600'000'000;
  events.push_back(AbsoluteEvent::at(1, 2, 0, Polarity::on));
  // Steps without a byte of their own must count, too, before a pause.
  for (int i = 0; i < 1000; ++i)
    events.push_back(AbsoluteEvent::at(1, 2, events.back().t + 100, Polarity::on));
  events.push_back(AbsoluteEvent::at(1, 2, step, Polarity::on));
  const auto encoder = make_event_stream_encoder({320, 240});
  const auto decoder = make_event_stream_decoder();
  EXPECT_EQ(decode(*decoder, recordings::encode(*encoder, events)).events, events);
}

}  // namespace
