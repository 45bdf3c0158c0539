// SPDX-License-Identifier: LGPL-2.1-or-later
// Hand-made DAT files.
#include "src/formats/dat/dat.hpp"

#include <gtest/gtest.h>

#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using recordings::decode;

struct Record {
  std::uint32_t t;
  std::uint32_t place;
};

std::vector<std::uint8_t> file(const std::string& header, std::uint8_t type,
                               std::initializer_list<Record> records, std::uint8_t size = 8) {
  std::vector<std::uint8_t> bytes(header.begin(), header.end());
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
  const auto decoded =
      decode(*decoder,
             file("% Data file containing CD events.\n% Version 2\n% Date 2017-3-1 9:30:00\n"
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
        decode(*decoder, file(header, 0x00, {{5, 303 | 239U << 9 | 1U << 17}, {6, 7U << 18}}));
    EXPECT_EQ(decoded.events, (std::vector{AbsoluteEvent::at(303, 239, 5, Polarity::on),
                                           AbsoluteEvent::at(0, 0, 6, Polarity::off)}));
    EXPECT_EQ(decoder->size(), (SensorSize{304, 240}));
  }
}

TEST(Dat, ReadsTriggers) {
  const auto decoder = make_dat_decoder();
  const auto decoded =
      decode(*decoder, file("% Version 2\n% end\n", 0x0e, {{5, 6U << 26 | 1}, {9, 6U << 26}}));
  EXPECT_EQ(decoded.triggers, (std::vector<Trigger>{{5, 6, true}, {9, 6, false}}));
  EXPECT_TRUE(decoded.events.empty());
}

TEST(Dat, FollowsWrapsAndKeepsDisorder) {
  const auto times_of = [](std::initializer_list<Record> records) {
    std::vector<Microseconds> times;
    for (const auto& event : decode(*make_dat_decoder(), file(version_2, 0x0c, records)).events)
      times.push_back(event.t);
    return times;
  };
  constexpr auto lap = Microseconds{1} << 32;
  EXPECT_EQ(
      times_of({{0xfffffff0, 0}, {3, 0}, {2, 0}, {0xf0000000, 0}, {1, 0}}),
      (std::vector<Microseconds>{0xfffffff0, lap + 3, lap + 2, lap + 0xf0000000, 2 * lap + 1}));
  EXPECT_EQ(times_of({{0xffffffff, 0},
                      {2, 0},
                      {0xfffffffe, 0},
                      {3, 0},
                      {0xffff0000, 0},
                      {0xffff0001, 0},
                      {4, 0}}),
            (std::vector<Microseconds>{lap - 1, lap + 2, lap - 2, lap + 3, lap - 0x10000,
                                       lap - 0xffff, lap + 4}));
}

TEST(Dat, IsAnErrorThatSaysWhy) {
  const auto error = [](const std::vector<std::uint8_t>& bytes) {
    return recordings::refusal(*make_dat_decoder(), bytes);
  };
  EXPECT_NE(error({}), "");
  EXPECT_NE(error({'%', ' ', 'a', '\n'}), "");
  EXPECT_NE(error({'R', 'I', 'F', 'F'}), "");
  EXPECT_NE(error(file("% Version 3\n% end\n", 0x0c, {})).find('3'), std::string::npos);
  EXPECT_NE(error(file(version_2, 0x28, {})).find("40"), std::string::npos);
  EXPECT_NE(error(file(version_2, 0x0c, {}, 16)).find("16"), std::string::npos);
}

TEST(Dat, IsWrittenAsTheToolsOfTheVendorDo) {
  const auto encoder = make_dat_encoder({1280, 720});
  const std::vector events{AbsoluteEvent::at(1279, 719, 5, Polarity::on)};
  EXPECT_EQ(recordings::encode(*encoder, events),
            file("% Data file containing CD events.\n% Version 2\n% Height 720\n% Width 1280\n"
                 "% end\n",
                 0x0c, {{5, 1279 | 719U << 14 | 1U << 28}}));
  EXPECT_THROW(make_dat_encoder({16385, 1}), std::invalid_argument);
}

/// The times that are read of those that are written.
std::vector<Microseconds> read_again(std::initializer_list<Microseconds> times,
                                     std::uint64_t removed) {
  std::vector<AbsoluteEvent> events;
  for (const auto t : times) events.push_back(AbsoluteEvent::at(1, 2, t, Polarity::on));
  const auto encoder = make_dat_encoder({320, 240});
  const auto bytes = recordings::encode(*encoder, events);
  EXPECT_EQ(encoder->removed_time(), removed);
  std::vector<Microseconds> read;
  for (const auto& event : decode(*make_dat_decoder(), bytes).events) read.push_back(event.t);
  return read;
}

TEST(Dat, IsWrittenWithTimesThatItsReadersCanTell) {
  using Times = std::vector<Microseconds>;
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

}  // namespace
