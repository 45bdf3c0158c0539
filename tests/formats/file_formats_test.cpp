// SPDX-License-Identifier: LGPL-2.1-or-later
// The table of formats, and recognition of files by their first bytes.

#include <gtest/gtest.h>

#include <algorithm>
#include <span>
#include <string>
#include <string_view>

#include "src/formats/file_formats.hpp"
#include "tests/formats/formats.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using recordings::Bytes;
using namespace std::string_literals;
using namespace std::string_view_literals;

/// What a file is, by its first bytes, as GStreamer chooses among typefinders.
struct Recognised {
  std::string_view media_type;  ///< empty if the format is unknown
  Likelihood likelihood = Likelihood::none;

  friend bool operator==(const Recognised&, const Recognised&) = default;
};

Recognised recognise(std::span<const std::uint8_t> start) {
  Recognised best;
  for (const auto& format : file_formats()) {
    const auto found = likelihood(format, start);
    if (found > best.likelihood) best = {format.media_type, found};
  }
  return best;
}

Recognised recognise(std::string_view text) {
  return recognise({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

Recognised certain(std::string_view type) {
  return {type, Likelihood::certain};
}

constexpr auto hdf5 = "\x89HDF\r\n\x1a\n"sv;
constexpr auto npz =
    "PK\x03\x04-\0\0\0\0\0\0\0!\0....\xff\xff\xff\xff\xff\xff\xff\xff\x05\0\x14\0t.npy"sv;
constexpr auto lines_of_events = "1,2,100,1\n3,4,200,0\n5,6,300,1\n"sv;

TEST(Recognition, KnowsFilesByTheirFirstBytes) {
  const std::pair<std::string_view, std::string_view> starts[] = {
      {"#!AER-DAT2.0\r\n", "application/x-aedat"},
      {"#!AER-DAT4.", "application/x-aedat"},
      {"Event Stream", "application/x-es"},
      {"\x93NUMPY", "application/x-npy"},
      {npz, "application/x-npz"},
      {hdf5, "application/x-hdf5"},
      {"\x89MCAP0\r\n", "application/x-mcap"},
      {"#ROSBAG V2.0\n", "application/x-rosbag"},
      {"SQLite format 3\0..CREATE TABLE messages(id..CREATE TABLE topics(id"sv,
       "application/x-rosbag2-db3"},
      {"% evt 3.0\n", "application/x-prophesee-raw"},
      {"% date 1\n% format EVT4;height=1;width=1\n", "application/x-prophesee-raw"},
      {"% format EVT3\n", "application/x-prophesee-raw"},
      {"% evt is a comment\n% evt 2.1\r\n", "application/x-prophesee-raw"},
      {lines_of_events, "application/x-event-csv"},
      // Its time unit is missing, which is reported on reading.
      {"1000 1 2 1\n2000 1 2 1\n3000 1 2 1\n", "application/x-event-csv"}};
  for (const auto& [start, type] : starts) EXPECT_EQ(recognise(start), certain(type)) << start;
  const auto aedat3 = recordings::bytes_of("#!AER-DAT3.");
  EXPECT_EQ(file_format_of("application/x-aedat")->version(aedat3), 3);
  EXPECT_EQ(recognise("% Version 2\n% end\n\x0c\x08"),
            (Recognised{"application/x-prophesee-dat", Likelihood::high}));
  EXPECT_EQ(recognise(std::string(2048, '\0').append(hdf5)),
            (Recognised{"application/x-hdf5", Likelihood::possible}));
}

TEST(Recognition, LeavesOtherFilesAlone) {
  for (const auto text : {""sv,
                          "#!AER-DAT5.0"sv,
                          "#!AER-DAT4"sv,
                          "Event Strea"sv,
                          "% "sv,
                          "% a comment\n"sv,
                          "% evt is a comment\n"sv,
                          "% evt 3\n"sv,
                          "% evt .0\n"sv,
                          "% evt 3.\n"sv,
                          "% format EVT analysis\n"sv,
                          "% format EVT\n"sv,
                          "% format EVT3 analysis\n"sv,
                          "% Version 2\n% end\n\x0c\x10"sv,
                          "% Version 2\n% end\n\x0c"sv,
                          "A text of words.\n"sv,
                          "SQLite format 3\0..CREATE TABLE songs(id"sv,
                          "1,2,100,1\n3,4,200,0\n"sv,
                          "1,2,100,1\n3,4,200,0\n5,6,300,1\nfour\n"sv,
                          "1,2,100,1\n3,4,200,0\n5,6,300,1\n\0"sv})
    EXPECT_EQ(recognise(text), Recognised{}) << text;
  EXPECT_EQ(recognise(npz.substr(0, npz.size() - 1)), Recognised{});
  EXPECT_EQ(recognise(std::string(npz.substr(0, npz.size() - 3)) + "txt"), Recognised{});
  EXPECT_EQ(recognise(std::string(2047, '\0').append(hdf5)), Recognised{});
}

TEST(Recognition, AHeaderSaysMoreThanLinesThatWouldBeEvents) {
  EXPECT_EQ(recognise(std::string("% evt 3.0\n").append(lines_of_events)),
            certain("application/x-prophesee-raw"));
  EXPECT_EQ(recognise(std::string("% a comment\n").append(lines_of_events)),
            certain("application/x-event-csv"));
  EXPECT_EQ(recognise(std::string(lines_of_events).append(2048 - lines_of_events.size(), '\n') +
                      std::string(hdf5)),
            (Recognised{"application/x-hdf5", Likelihood::possible}));
}

TEST(Recognition, MoreBytesMakeNoOtherKind) {
  recordings::Random random(1);
  constexpr SensorSize size{640, 480};
  for (const auto& format : formats::all()) {
    if (format.name.starts_with("evt")) continue;  // words without a header
    const auto events = recordings::random_events(random, size, 20, 1000);
    const auto bytes = recordings::encode(*format.make_encoder(size), events);
    const auto whole = recognise(bytes);
    ASSERT_NE(whole.media_type, "") << format.name;
    for (std::size_t count = 0; count < bytes.size(); ++count) {
      const auto start = recognise(std::span(bytes).first(count));
      EXPECT_TRUE(start == Recognised{} || start == whole)
          << format.name << ", " << count << " bytes";
    }
  }
}

/// A file of N-MNIST.
Bytes n_mnist() {
  recordings::Random random(1);
  Bytes bytes;
  std::uint32_t t = 400;
  for (int i = 0; i < 1000; ++i) {
    t += static_cast<std::uint32_t>(recordings::below(random, 300));
    const auto upper = t >> 16 | static_cast<std::uint32_t>(i % 2) << 7;
    for (const auto byte :
         {static_cast<std::uint32_t>(i % 34), static_cast<std::uint32_t>(i % 31), upper, t >> 8, t})
      bytes.push_back(static_cast<std::uint8_t>(byte));
  }
  return bytes;
}

TEST(Recognition, KnowsNMnistByTheOrderOfItsTimes) {
  const auto file = n_mnist();
  EXPECT_EQ(recognise(file), (Recognised{"application/x-atis-bin", Likelihood::high}));
  EXPECT_EQ(recognise(std::span(file).first(500)), Recognised{}) << "too few events";

  auto shifted = file;
  shifted.erase(shifted.begin());
  EXPECT_EQ(recognise(shifted), Recognised{});
  EXPECT_EQ(recognise(Bytes(5000)), Recognised{});
  recordings::Random random(1);
  for (int i = 0; i < 200; ++i) {
    Bytes noise(5000);
    for (auto& byte : noise) byte = static_cast<std::uint8_t>(random());
    EXPECT_EQ(recognise(noise), Recognised{});
    for (std::size_t at = 0; at < noise.size(); ++at)
      noise[at] = static_cast<std::uint8_t>(at / static_cast<std::size_t>(1 + i % 7));
    EXPECT_EQ(recognise(noise), Recognised{});
  }
}

}  // namespace
