// SPDX-License-Identifier: LGPL-2.1-or-later
// Recognition of files by their first bytes.
#include "src/formats/recognition.hpp"

#include <gtest/gtest.h>

#include <string>
#include <string_view>

#include "tests/formats/formats.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using namespace std::string_literals;
using namespace std::string_view_literals;

std::optional<Recognised> recognise(std::string_view text) {
  return eventcamera::recognise({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

constexpr auto hdf5 = "\x89HDF\r\n\x1a\n"sv;
constexpr auto npz =
    "PK\x03\x04-\0\0\0\0\0\0\0!\0....\xff\xff\xff\xff\xff\xff\xff\xff\x05\0\x14\0t.npy"sv;
constexpr auto lines_of_events = "1,2,100,1\n3,4,200,0\n5,6,300,1\n"sv;

TEST(Recognition, KnowsFilesByTheirFirstBytes) {
  EXPECT_EQ(recognise("#!AER-DAT2.0\r\n"), (Recognised{FileKind::aedat, 2}));
  EXPECT_EQ(recognise("#!AER-DAT4."), (Recognised{FileKind::aedat, 4}));
  EXPECT_EQ(recognise("Event Stream"), Recognised{FileKind::event_stream});
  EXPECT_EQ(recognise("\x93NUMPY"), Recognised{FileKind::npy});
  EXPECT_EQ(recognise(npz), Recognised{FileKind::npz});
  EXPECT_EQ(recognise(hdf5), Recognised{FileKind::hdf5});
  EXPECT_EQ(recognise("\x89MCAP0\r\n"), Recognised{FileKind::mcap});
  EXPECT_EQ(recognise("#ROSBAG V2.0\n"), Recognised{FileKind::rosbag});
  EXPECT_EQ(recognise("SQLite format 3\0..CREATE TABLE messages(id..CREATE TABLE topics(id"sv),
            Recognised{FileKind::rosbag2_db3});
  EXPECT_EQ(recognise("SQLite format 3\0..CREATE TABLE songs(id"sv), std::nullopt);
  EXPECT_EQ(recognise("% evt 3.0\n"), Recognised{FileKind::prophesee_raw});
  EXPECT_EQ(recognise("% date 1\n% format EVT4;height=1;width=1\n"),
            Recognised{FileKind::prophesee_raw});
  EXPECT_EQ(recognise("% format EVT3\n"), Recognised{FileKind::prophesee_raw});
  EXPECT_EQ(recognise("% evt is a comment\n% evt 2.1\r\n"), Recognised{FileKind::prophesee_raw});
  EXPECT_EQ(recognise("% Version 2\n% end\n\x0c\x08"),
            (Recognised{FileKind::prophesee_dat, 0, false}));
  EXPECT_EQ(recognise(lines_of_events), Recognised{FileKind::csv});
  EXPECT_EQ(recognise(std::string(2048, '\0').append(hdf5)),
            (Recognised{FileKind::hdf5, 0, false}));
}

TEST(Recognition, LeavesOtherFilesAlone) {
  for (const auto text :
       {""sv, "#!AER-DAT5.0"sv, "#!AER-DAT4"sv, "Event Strea"sv, "% "sv, "% a comment\n"sv,
        "% evt is a comment\n"sv, "% evt 3\n"sv, "% evt .0\n"sv, "% evt 3.\n"sv,
        "% format EVT analysis\n"sv, "% format EVT\n"sv, "% format EVT3 analysis\n"sv,
        "% Version 2\n% end\n\x0c\x10"sv, "% Version 2\n% end\n\x0c"sv, "A text of words.\n"sv,
        "1,2,100,1\n3,4,200,0\n"sv, "1,2,100,1\n3,4,200,0\n5,6,300,1\nfour\n"sv,
        "1,2,100,1\n3,4,200,0\n5,6,300,1\n\0"sv})
    EXPECT_EQ(recognise(text), std::nullopt) << text;
  EXPECT_EQ(recognise(npz.substr(0, npz.size() - 1)), std::nullopt);
  EXPECT_EQ(recognise(std::string(npz.substr(0, npz.size() - 3)) + "txt"), std::nullopt);
  // Its time unit is missing, which is reported on reading.
  EXPECT_EQ(recognise("1000 1 2 1\n2000 1 2 1\n3000 1 2 1\n"), Recognised{FileKind::csv});
  EXPECT_EQ(recognise(std::string(2047, '\0').append(hdf5)), std::nullopt);
}

TEST(Recognition, FindsTheSameWhereOneKindIsWanted) {
  for (const auto& text :
       {""s, "#!AER-DAT4."s, "Event Stream"s, "\x93NUMPY"s, std::string(hdf5), std::string(npz),
        "% evt 3.0\n"s, "% Version 2\n% end\n\x0c\x08"s, std::string(lines_of_events),
        std::string("% a comment\n").append(lines_of_events), "A text of words.\n"s,
        std::string(2048, '\0').append(hdf5), std::string(2048, '\n').append(hdf5)}) {
    const std::span bytes(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    const auto found = eventcamera::recognise(bytes);
    for (const auto kind :
         {FileKind::aedat, FileKind::csv, FileKind::event_stream, FileKind::hdf5, FileKind::mcap,
          FileKind::npy, FileKind::npz, FileKind::prophesee_dat, FileKind::prophesee_raw}) {
      const auto wanted = eventcamera::recognise(bytes, kind);
      if (found && found->kind == kind)
        EXPECT_EQ(wanted, found) << text;
      else
        EXPECT_TRUE(!wanted || wanted->kind != kind) << text;
    }
  }
}

TEST(Recognition, AHeaderSaysMoreThanLinesThatWouldBeEvents) {
  EXPECT_EQ(recognise(std::string("% evt 3.0\n").append(lines_of_events)),
            Recognised{FileKind::prophesee_raw});
  EXPECT_EQ(recognise(std::string("% a comment\n").append(lines_of_events)),
            Recognised{FileKind::csv});
}

TEST(Recognition, MoreBytesMakeNoOtherKind) {
  recordings::Random random(1);
  constexpr SensorSize size{640, 480};
  for (const auto& format : formats::all()) {
    if (format.name.starts_with("evt")) continue;  // words without a header
    const auto events = recordings::random_events(random, size, 20, 1000);
    const auto bytes = recordings::encode(*format.make_encoder(size), events);
    const auto whole = eventcamera::recognise(bytes);
    ASSERT_TRUE(whole) << format.name;
    for (std::size_t count = 0; count < bytes.size(); ++count) {
      const auto start = eventcamera::recognise(std::span(bytes).first(count));
      EXPECT_TRUE(!start || start == whole) << format.name << ", " << count << " bytes";
    }
  }
}

}  // namespace
