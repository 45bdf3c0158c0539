// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <map>

#include "src/formats/numpy/npz.hpp"
#include "src/formats/numpy/zip_archive.hpp"
#include "src/formats/temporary_file.hpp"
#include "tests/formats/npz_file.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace recordings;
using npz_file::archive;
using npz_file::column;
using npz_file::columns_of_events;
using npz_file::Member;

struct Read {
  Events events;
  SensorSize size;
  Corruption corruption;
};

Read all_of(Decoder& reader) {
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
  pushed->drain();
  MemoryBytes source(bytes);
  const auto pulled = make_npz_decoder(settings);
  EXPECT_TRUE(pulled->open(source));
  auto read = all_of(*pulled);
  const auto other = all_of(*pushed);
  EXPECT_EQ(other.events, read.events);
  EXPECT_EQ(other.size, read.size);
  return read;
}

Events events_of(std::size_t count) {
  Events events;
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

TEST(Npz, NamesOfAnyTool) {
  const auto events = events_of(5000);
  auto coords = columns_of_events(events);
  coords[0].first = "x_coords.npy";
  coords[2].first = "y_coords.npy";
  coords[3].first = "timestamps.npy";
  coords[4].first = "polarities.npy";
  EXPECT_EQ(read(archive(coords, true)).events, events);
  // EVIMO2.
  std::vector<std::uint16_t> xy;
  for (const auto& event : events)
    xy.insert(xy.end(), {event.x, static_cast<std::uint16_t>(event.y())});
  const std::vector<Member> evimo{
      {"dataset_events_xy.npy", npz_file::array("'<u2'", "(5000, 2)", xy)},
      {"dataset_events_t.npy", coords[3].second},
      {"dataset_events_p.npy", coords[4].second}};
  EXPECT_EQ(read(archive(evimo, true)).events, events);
}

Member plain_array(const std::string& name, std::size_t rows, std::size_t columns) {
  const auto shape = "(" + std::to_string(rows) + ", " + std::to_string(columns) + ")";
  return {name, npz_file::array("'<f8'", shape, std::vector<double>(rows * columns, 1))};
}

TEST(Npz, AnArrayOfEventsAmongOthers) {
  const std::vector<double> numbers = {0.5, 3, 4, 1, 0.75, 5, 6, 0};
  const Events expected = {AbsoluteEvent::at(3, 4, 500'000, Polarity::on),
                           AbsoluteEvent::at(5, 6, 750'000, Polarity::off)};
  const Member rows = {"arr_0.npy", npz_file::array("'<f8'", "(2, 4)", numbers)};
  const Member fields = {
      "events.npy",
      npz_file::array("[('t', '<f8'), ('x', '<f8'), ('y', '<f8'), ('p', '<f8')]", "(2,)", numbers)};
  const Member other = {"frame.npy", column<double>("<f8", numbers)};
  const Member text = {"readme.txt", bytes_of("hello")};
  const auto matrix = plain_array("K.npy", 3, 3);
  const auto poses = plain_array("poses.npy", 10, 5);
  for (const auto& member : {rows, fields})
    for (const bool is_compressed : {false, true})
      EXPECT_EQ(read(archive({text, other, matrix, member}, is_compressed)).events, expected);
  EXPECT_EQ(read(archive({poses, matrix, rows}, true), {.columns = *columns_of("txyp")}).events,
            expected);
}

TEST(Npz, WhatIsWrongIsToldAndWhatIsWholeIsRead) {
  const auto events = events_of(50'000);
  auto shorter = columns_of_events(events);
  shorter[2] = columns_of_events(events_of(100))[2];
  const auto cut = read(archive(shorter, true));
  EXPECT_EQ(cut.events.size(), 100U);
  EXPECT_EQ(cut.corruption.places, 1U);

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
}

TEST(Npz, WhatIsNoneIsRefused) {
  const auto refused = [](const Bytes& bytes, std::string_view words,
                          const TableSettings& settings = {}) {
    try {
      read(bytes, settings);
      ADD_FAILURE() << words;
    } catch (const UnsupportedFormat& error) {
      EXPECT_NE(std::string_view(error.what()).find(words), std::string_view::npos) << error.what();
    }
  };
  const auto archive_of = [](const Member& member) { return archive({member}, true); };
  const auto array = [](const char* type, const char* shape, std::size_t count) {
    return Member{"a.npy", npz_file::array(type, shape, std::vector<double>(count))};
  };
  auto columns = columns_of_events(events_of(10));
  auto cut = archive(columns, true);
  cut.resize(cut.size() - 30);
  refused({}, "neither arrays t, x, y and p");
  refused(bytes_of("hello, this is a text"), "cannot be opened");
  refused(cut, "cannot be opened");
  refused(archive_of({"readme.txt", bytes_of("hello")}), "neither arrays t, x, y and p");
  refused(archive_of(array("'<f8'", "(3, 500)", 1500)), "(N, 4) or (4, N)");
  refused(archive_of(array("'|O'", "()", 1)), "pickled");
  refused(archive_of(plain_array("K.npy", 3, 3)), "K.npy: the NumPy array has 3 columns");
  const auto poses = archive_of(plain_array("poses.npy", 10, 5));
  refused(poses, "column-order has 4", {.columns = *columns_of("txyp")});
  refused(poses, "set column-order for all 5");
  auto wide = columns;
  wide[0].second = npz_file::array("'<u2'", "(10, 2)", std::vector<std::uint16_t>(20));
  refused(archive(wide, true), "must have one column");
  columns.pop_back();
  refused(archive(columns, true), "neither arrays t, x, y and p");
}

/// Archive as an encoder writes it. Checks that its end comes in pieces.
Bytes written(Encoder& encoder, std::span<const AbsoluteEvent> events, std::size_t at_once = 1000) {
  constexpr std::size_t max_piece = 300'000;
  Bytes bytes;
  encoder.encode({}, bytes);
  const auto header = bytes.size();
  for (auto rest = events; !rest.empty(); rest = rest.subspan(std::min(at_once, rest.size())))
    encoder.encode(rest.first(std::min(at_once, rest.size())), bytes);
  EXPECT_EQ(bytes.size(), header);
  EXPECT_EQ(encoder.pending(), events.size());
  for (bool more = true; more;) {
    const auto before = bytes.size();
    more = encoder.finish(bytes);
    EXPECT_LT(bytes.size() - before, max_piece);
  }
  EXPECT_EQ(encoder.pending(), 0U);
  return bytes;
}

TEST(NpzEncoder, ComesBackWithTheSensorSize) {
  for (const auto size : {SensorSize{1, 1}, {640, 480}, {16384, 16384}}) {
    for (const std::size_t count : {0, 1, 5000, 100'000}) {
      const auto events = random_events(size, count, 1, -1000);
      const auto bytes = written(*make_npz_encoder(size), events);
      const auto found = read(bytes);
      EXPECT_TRUE(found.events == events) << count;
      EXPECT_EQ(found.size, size);
      EXPECT_EQ(found.corruption.places + found.corruption.outside, 0U);
      EXPECT_EQ(written(*make_npz_encoder(size), events, 77), bytes) << "it depends on the pieces";
    }
  }
}

TEST(NpzEncoder, LeavesNoFiles) {
  auto folder = (std::filesystem::temp_directory_path() / "npz-test-XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  setenv("TMPDIR", folder.c_str(), 1);
  const auto encoder = make_npz_encoder({640, 480});
  EXPECT_TRUE(std::filesystem::is_empty(folder));
  std::filesystem::remove(folder);
  EXPECT_THROW(make_npz_encoder({640, 480}), TemporaryFileError);
  unsetenv("TMPDIR");
}

TEST(NpzEncoder, FailsOnAFullDisk) {
  const auto events = events_of(20'000);
  Bytes bytes;
  const auto encoder = make_npz_encoder({640, 480});
  rlimit before = {};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small = {.rlim_cur = 100'000, .rlim_max = before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  EXPECT_THROW(encoder->encode(events, bytes), TemporaryFileError);
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
}

TEST(Npz, NumbersOfTheSensorSize) {
  const auto read_with = [](const Member& width, const Member& height,
                            const TableSettings& settings = {}) {
    auto members = columns_of_events(events_of(10));
    members.push_back(width);
    members.push_back(height);
    return read(archive(members, true), settings);
  };
  const auto floating = [](const std::string& name, double value) {
    return Member{name, npz_file::array<double>("'<f8'", "()", {value})};
  };
  const auto one = [](const std::string& name, std::int64_t value) {
    return Member{name, npz_file::array<std::int64_t>("'<i8'", "()", {value})};
  };
  const Member in_array{"width.npy", column<std::uint16_t>("<u2", {640})};
  const auto width = one("width.npy", 640);
  EXPECT_EQ(read_with(width, one("height.npy", 480)).size, (SensorSize{640, 480}));
  EXPECT_EQ(read_with(in_array, floating("height.npy", 480)).size, (SensorSize{640, 480}));
  EXPECT_EQ(read_with(one("a/width.npy", 16384), one("a/height.npy", 16384)).size,
            (SensorSize{16384, 16384}));

  // The size of the settings comes first; events outside are counted.
  const auto set = read_with(width, one("height.npy", 480), {.size = SensorSize{320, 240}});
  EXPECT_EQ(set.size, (SensorSize{320, 240}));
  const auto small = read_with(one("width.npy", 9), one("height.npy", 480));
  EXPECT_EQ(small.events.size(), 9U);
  EXPECT_EQ(small.corruption.outside, 1U);

  // One alone is ignored, and an impossible size is corruption.
  const auto none = read_with(width, one("other.npy", 480));
  EXPECT_EQ(none.size, SensorSize{});
  EXPECT_EQ(none.corruption.places, 0U);
  for (const auto& height :
       {one("height.npy", 0), one("height.npy", -1), one("height.npy", 32769),
        floating("height.npy", std::nan("")), Member{"height.npy", bytes_of("not an array")},
        Member{"height.npy", column<double>("<f8", {1, 2})},
        Member{"height.npy", npz_file::array<std::int64_t>("'<i8'", "()", {})}}) {
    const auto found = read_with(width, height);
    EXPECT_EQ(found.size, SensorSize{});
    EXPECT_EQ(found.events.size(), 10U);
    EXPECT_EQ(found.corruption.places, 1U);
  }
}

/// A flipped bit in the size is not another size.
TEST(Npz, ChecksTheSensorSize) {
  const auto bytes = written(*make_npz_encoder({640, 480}), events_of(20));
  auto flipped = bytes;
  const auto at = flipped.begin() + 30 + 9 + 20 + 128;
  ASSERT_EQ(*at, 640 & 0xff);
  *at ^= 1;
  const auto found = read(flipped);
  EXPECT_EQ(found.size, SensorSize{});
  EXPECT_EQ(found.events.size(), 20U);
  EXPECT_EQ(found.corruption.places, 1U);
}

/// File of zeros, with some bytes in between.
class SparseBytes final : public ByteSource {
 public:
  void put(std::uint64_t position, Bytes bytes) { bytes_.emplace(position, std::move(bytes)); }

  std::uint64_t size() const override {
    const auto& [position, bytes] = *bytes_.rbegin();
    return position + bytes.size();
  }

  std::optional<std::size_t> read(std::uint64_t position,
                                  std::span<std::uint8_t> out) noexcept override {
    const auto count = std::min<std::uint64_t>(out.size(), size() - std::min(size(), position));
    std::ranges::fill(out.first(count), 0);
    for (const auto& [begin, bytes] : bytes_) {
      const auto first = std::max(begin, position);
      const auto end = std::min(begin + bytes.size(), position + count);
      for (auto at = first; at < end; ++at) out[at - position] = bytes[at - begin];
    }
    return count;
  }

  std::optional<std::span<const std::uint8_t>> piece(std::uint64_t) override { return {}; }

 private:
  std::map<std::uint64_t, Bytes> bytes_;
};

TEST(ZipWriter, WritesFilesOfAnySize) {
  constexpr std::uint64_t large = 0xffffffff;
  for (const std::uint64_t size : {std::uint64_t{5}, large - 1, large, 3 * large}) {
    SparseBytes file;
    ZipWriter writer;
    Bytes bytes;
    std::uint64_t end = 0;
    const auto put = [&](std::uint64_t content) {
      file.put(end, bytes);
      end += bytes.size() + content;
      bytes.clear();
    };
    const Bytes few = {1, 2, 3};
    constexpr std::uint32_t checksum_of_few = 0x55bc801d;
    for (const auto* const name : {"first", "last"}) {
      writer.begin_file(name, few.size(), checksum_of_few, bytes);
      bytes.insert(bytes.end(), few.begin(), few.end());
      if (name == std::string("last")) continue;
      writer.begin_file("zeros", size, 0, bytes);
      put(size);
    }
    writer.finish(bytes);
    put(0);

    ZipArchive archive(file);
    EXPECT_EQ(archive.names(), (std::vector<std::string>{"first", "zeros", "last"}));
    for (const std::size_t index : {0, 1, 2}) {
      Bytes found(few.size(), 9);
      EXPECT_EQ(archive.open(index).read(found), few.size());
      EXPECT_EQ(found, index == 1 ? Bytes(few.size()) : few) << index;
    }
  }
}

/// KiB by which the memory of the process grows.
template <class Work>
long grown(const Work& work) {
  rusage before = {};
  rusage after = {};
  getrusage(RUSAGE_SELF, &before);
  work();
  getrusage(RUSAGE_SELF, &after);
  return after.ru_maxrss - before.ru_maxrss;
}

constexpr long grown_limit = 65536;

TEST(NpzEncoder, TakesTheSameMemoryForAnyNumberOfEvents) {
  const auto growth = grown([] {
    const auto events = events_of(20'000);
    const auto encoder = make_npz_encoder({640, 480});
    Bytes bytes;
    for (int i = 0; i < 1000; ++i) encoder->encode(events, bytes);
    do bytes.clear();
    while (encoder->finish(bytes));
  });
  EXPECT_LT(growth, grown_limit);
}

/// Memory stays small for any sizes stated in an archive.
TEST(Npz, ClaimsTakeNoMemory) {
  const auto read_whole = [](const Bytes& bytes) {
    try {
      MemoryBytes source(bytes);
      const auto reader = make_npz_decoder();
      reader->open(source);
      while (reader->next()) continue;
    } catch (const UnsupportedFormat&) {
      // May be refused.
    }
  };

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
    EXPECT_LT(grown([&] { read_whole(large); }), grown_limit) << files;
  }

  // Zeros, which compress to a thousandth of their size, are read in small pieces.
  const auto bomb = columns_of_events(Events(1'000'000));
  MemoryBytes source(archive(bomb, true));
  EXPECT_LT(source.size(), 100'000U);
  const auto reader = make_npz_decoder();
  reader->open(source);
  while (const auto item = reader->next())
    EXPECT_LE(std::get<EventItem>(*item).events.size(), 65'536U);
}

}  // namespace
