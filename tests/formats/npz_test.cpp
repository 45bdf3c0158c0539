// SPDX-License-Identifier: LGPL-2.1-or-later
#include <sys/resource.h>

#include <cmath>
#include <numeric>

#include "src/formats/numpy/npz_decoder.hpp"
#include "tests/formats/npz_file.hpp"
#include "tests/formats/table_events.hpp"

namespace {

using namespace table_events;
using npz_file::archive;
using npz_file::column;
using npz_file::columns_of_events;
using npz_file::Member;

struct Read {
  std::vector<AbsoluteEvent> events;
  SensorSize size;
  Corruption corruption;
};

Read all_of(RecordingDecoder& reader) {
  Read read;
  read.size = reader.streams().front().size;
  while (const auto item = reader.next()) {
    const auto events = std::get<EventItem>(*item).events;
    read.events.insert(read.events.end(), events.begin(), events.end());
  }
  read.corruption = reader.corruption();
  return read;
}

/// Output in pull mode, after checking that push mode gives the same.
Read read(const Bytes& bytes, const TableSettings& settings = {}) {
  const auto pushed = make_npz_decoder(settings);
  for (std::size_t at = 0; at < bytes.size(); at += 1000) {
    pushed->push(std::span(bytes).subspan(at, std::min<std::size_t>(1000, bytes.size() - at)));
    EXPECT_FALSE(pushed->next());
  }
  pushed->finish();
  MemoryBytes source(bytes);
  const auto pulled = make_npz_decoder(settings);
  EXPECT_TRUE(pulled->open(source));
  auto read = all_of(*pulled);
  const auto other = all_of(*pushed);
  EXPECT_EQ(other.events, read.events);
  EXPECT_EQ(other.size, read.size);
  return read;
}

std::vector<AbsoluteEvent> events_of(std::size_t count) {
  std::vector<AbsoluteEvent> events;
  for (std::size_t i = 0; i < count; ++i)
    events.push_back(AbsoluteEvent::at(static_cast<int>(i % 640), static_cast<int>(i * 7 % 480),
                                       static_cast<Microseconds>(i * 3),
                                       i % 3 == 0 ? Polarity::on : Polarity::off));
  return events;
}

TEST(Npz, ArraysOfTheColumns) {
  for (const std::size_t count : {0, 1, 4095, 4096, 50'000}) {
    const auto events = events_of(count);
    for (const bool is_compressed : {false, true}) {
      const auto found = read(archive(columns_of_events(events), is_compressed));
      EXPECT_TRUE(found.events == events) << count;
      EXPECT_EQ(found.corruption.places, 0U);
    }
  }
  auto named = columns_of_events(events_of(10));
  named[0].first = "folder/xs.npy";
  named[3].first = "timestamp_ns.npy";
  EXPECT_EQ(read(archive(named, true)).events[9].t, 0);
  EXPECT_EQ(read(archive(named, true), {.unit = TimeUnit::seconds}).events[9].t, 27'000'000);
}

TEST(Npz, AnArrayOfEvents) {
  const std::vector<double> numbers = {0.5, 3, 4, 1, 0.75, 5, 6, 0};
  const std::vector<AbsoluteEvent> expected = {AbsoluteEvent::at(3, 4, 500'000, Polarity::on),
                                               AbsoluteEvent::at(5, 6, 750'000, Polarity::off)};
  const Member rows = {"arr_0.npy", npz_file::array("'<f8'", "(2, 4)", numbers)};
  const Member fields = {
      "events.npy",
      npz_file::array("[('t', '<f8'), ('x', '<f8'), ('y', '<f8'), ('p', '<f8')]", "(2,)", numbers)};
  const Member other = {"frame.npy", column<double>("<f8", numbers)};
  const Member text = {"readme.txt", bytes_of("hello")};
  for (const auto& member : {rows, fields})
    for (const bool is_compressed : {false, true})
      EXPECT_EQ(read(archive({text, other, member}, is_compressed)).events, expected);
}

TEST(Npz, WhatIsWrongIsToldAndWhatIsWholeIsRead) {
  const auto events = events_of(50'000);
  auto shorter = columns_of_events(events);
  shorter[2] = columns_of_events(events_of(100))[2];
  EXPECT_EQ(read(archive(shorter, true)).events.size(), 100U);

  auto claims = columns_of_events(events);
  for (auto& [name, bytes] : claims) {
    const std::string text(bytes.begin(), bytes.end());
    const auto at = text.find("50000");
    bytes[at] = '9';
  }
  const auto fewer = read(archive(claims, true));
  EXPECT_EQ(fewer.events.size(), 50'000U);
  EXPECT_EQ(fewer.corruption.places, 1U);

  auto flipped = archive(columns_of_events(events), false);
  for (std::size_t at = 300'000; at < 300'010; ++at) flipped[at] ^= 0xff;
  EXPECT_GT(read(flipped).corruption.places, 0U);

  // Wrong checksum of an array: events decompressed before are kept.
  auto changed = archive(columns_of_events(events), true);
  changed[changed.size() / 2] ^= 0x55;
  try {
    EXPECT_GT(read(changed).corruption.places, 0U);
  } catch (const UnsupportedFormat&) {
    // A header may have been corrupted.
  }
}

TEST(Npz, WhatIsNoneIsRefused) {
  const auto whole = archive(columns_of_events(events_of(1000)), true);
  const auto refused = [](const Bytes& bytes, std::string_view words) {
    try {
      read(bytes);
      ADD_FAILURE() << words;
    } catch (const UnsupportedFormat& error) {
      EXPECT_NE(std::string_view(error.what()).find(words), std::string_view::npos) << error.what();
    }
  };
  refused({}, "neither arrays t, x, y and p");
  refused(bytes_of("hello, this is a text"), "cannot be opened");
  refused(Bytes(whole.begin(), whole.end() - 30), "cannot be opened");
  refused(archive({{"readme.txt", bytes_of("hello")}}, true), "neither arrays t, x, y and p");
  auto lacks = columns_of_events(events_of(10));
  lacks.pop_back();
  refused(archive(lacks, true), "neither arrays t, x, y and p");
  refused(
      archive({{"a.npy", npz_file::array("'<f8'", "(4, 500)", std::vector<double>(2000))}}, true),
      "numpy.ascontiguousarray");
  auto wide = columns_of_events(events_of(10));
  wide[0].second = npz_file::array("'<u2'", "(10, 2)", std::vector<std::uint16_t>(20));
  refused(archive(wide, true), "not an array of one column");
}

TEST(Npz, NumbersOfTheSensorSize) {
  const auto size_of = [](const Member& width, const Member& height,
                          const TableSettings& settings = {}) {
    auto members = columns_of_events(events_of(10));
    members.push_back(width);
    members.push_back(height);
    return read(archive(members, true), settings);
  };
  const auto floating = [](const std::string& name, double value) {
    return Member{name, npz_file::array<double>("'<f8'", "()", {value})};
  };
  const auto in_array = [](const std::string& name, std::uint16_t value) {
    return Member{name, column<std::uint16_t>("<u2", {value})};
  };
  const auto one = [](const std::string& name, std::int64_t value) {
    return Member{name, npz_file::array<std::int64_t>("'<i8'", "()", {value})};
  };
  constexpr SensorSize size = {640, 480};
  EXPECT_EQ(size_of(one("width.npy", 640), one("height.npy", 480)).size, size);
  EXPECT_EQ(size_of(in_array("width.npy", 640), floating("height.npy", 480)).size, size);
  EXPECT_EQ(size_of(one("a/width.npy", 65535), one("a/height.npy", 32768)).size,
            (SensorSize{65535, 32768}));

  // That of the settings comes first; events outside are counted.
  const auto set =
      size_of(one("width.npy", 640), one("height.npy", 480), {.size = SensorSize{320, 240}});
  EXPECT_EQ(set.size, (SensorSize{320, 240}));
  const auto small = size_of(one("width.npy", 9), one("height.npy", 480));
  EXPECT_EQ(small.events.size(), 9U);
  EXPECT_EQ(small.corruption.outside, 1U);

  // One alone says nothing, and what is no size is corruption.
  const auto none = size_of(one("width.npy", 640), one("other.npy", 480));
  EXPECT_EQ(none.size, SensorSize{});
  EXPECT_EQ(none.corruption.places, 0U);
  const Member text = {"height.npy", bytes_of("not an array")};
  for (const auto& height :
       {one("height.npy", 0), one("height.npy", -1), one("height.npy", 32769),
        floating("height.npy", std::nan("")), text,
        Member{"height.npy", column<double>("<f8", {1, 2})},
        Member{"height.npy", npz_file::array<std::int64_t>("'<i8'", "()", {})}}) {
    const auto found = size_of(one("width.npy", 640), height);
    EXPECT_EQ(found.size, SensorSize{});
    EXPECT_EQ(found.events.size(), 10U);
    EXPECT_EQ(found.corruption.first, "the arrays width and height are not a sensor size");
  }
}

/// Memory stays small for any sizes stated in an archive.
TEST(Npz, ClaimsTakeNoMemory) {
  const auto grown = [](const Bytes& bytes) {
    rusage before = {};
    rusage after = {};
    getrusage(RUSAGE_SELF, &before);
    try {
      MemoryBytes source(bytes);
      const auto reader = make_npz_decoder();
      reader->open(source);
      while (reader->next()) continue;
    } catch (const UnsupportedFormat&) {
      // May be refused.
    }
    getrusage(RUSAGE_SELF, &after);
    return after.ru_maxrss - before.ru_maxrss;  // KiB
  };
  constexpr long limit = 65536;

  // End record of a missing directory of 2^32 files.
  Bytes claims = archive({{"t.npy", bytes_of("hello")}}, false);
  const auto end = claims.size() - 22;
  const auto put = [](Bytes& bytes, std::size_t at, std::uint64_t value, int count) {
    for (int i = 0; i < count; ++i)
      bytes[at + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(value >> 8 * i);
  };
  for (const std::uint64_t files : {std::uint64_t{0xffff}, std::uint64_t{1} << 32}) {
    Bytes zip64(56 + 20);
    put(zip64, 0, 0x06064b50, 4);
    put(zip64, 4, 44, 8);
    put(zip64, 24, files, 8);
    put(zip64, 32, files, 8);
    put(zip64, 40, files * 46, 8);
    put(zip64, 56, 0x07064b50, 4);
    put(zip64, 64, end, 8);
    put(zip64, 72, 1, 4);
    auto large = claims;
    large.insert(large.begin() + static_cast<std::ptrdiff_t>(end), zip64.begin(), zip64.end());
    for (const auto at : {8U, 10U}) put(large, end + zip64.size() + at, 0xffff, 2);
    for (const auto at : {12U, 16U}) put(large, end + zip64.size() + at, 0xffffffff, 4);
    EXPECT_LT(grown(large), limit) << files;
  }

  // Zeros, which compress to a thousandth of their size, are read in small pieces.
  const auto bomb = columns_of_events(std::vector<AbsoluteEvent>(1'000'000));
  MemoryBytes source(archive(bomb, true));
  EXPECT_LT(source.size(), 100'000U);
  const auto reader = make_npz_decoder();
  reader->open(source);
  while (const auto item = reader->next())
    EXPECT_LE(std::get<EventItem>(*item).events.size(), 65'536U);
}

}  // namespace
