// SPDX-License-Identifier: LGPL-2.1-or-later
#include <gtest/gtest.h>
#include <hdf5.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "src/formats/byte_source.hpp"
#include "src/formats/hdf5/ecf.hpp"
#include "src/formats/hdf5/hdf5_decoder.hpp"
#include "src/formats/hdf5/hdf5_filters.hpp"
#include "src/formats/hdf5/hdf5_writer.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace recordings;

using Compression = Hdf5Writer::Compression;
using Settings = Hdf5Writer::Settings;

constexpr SensorSize vga{640, 480};
constexpr Settings metavision = {Hdf5Format::metavision, Compression::none, vga};

Bytes bytes_in(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

class Hdf5 : public testing::Test {
 protected:
  Hdf5()
      : folder_(std::filesystem::temp_directory_path() /
                ("hdf5_test." + std::to_string(getpid()) + "." +
                 testing::UnitTest::GetInstance()->current_test_info()->name())) {
    std::filesystem::create_directories(folder_);
  }
  ~Hdf5() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path path(const std::string& name = "events.h5") const { return folder_ / name; }

  Bytes write(std::span<const AbsoluteEvent> events, const Settings& settings,
              std::size_t at_once = 5000) const {
    Hdf5Writer writer(path(), settings);
    for (; !events.empty(); events = events.subspan(std::min(at_once, events.size())))
      writer.append(events.first(std::min(at_once, events.size())));
    writer.close();
    return bytes_in(path());
  }

 private:
  std::filesystem::path folder_;
};

std::vector<Settings> all_settings() {
  return {{Hdf5Format::dsec, Compression::none, vga},
          {Hdf5Format::dsec, Compression::gzip, vga},
          metavision};
}

struct Read {
  explicit Read(Bytes file) : bytes(std::move(file)) {
    decoder->open(bytes);
    contents.take_all(*decoder);
  }

  Contents from(Microseconds t) const {
    Contents rest;
    decoder->restart({.t = t});
    rest.take_all(*decoder);
    return rest;
  }

  MemoryBytes bytes;
  std::unique_ptr<Decoder> decoder = make_hdf5_decoder();
  Contents contents;
};

Events read_all(const Bytes& file) {
  return Read(file).contents.events;
}

std::vector<std::uint16_t> numbers_in(const std::filesystem::path& file, const char* dataset) {
  const hid_t opened = H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  const hid_t data = H5Dopen2(opened, dataset, H5P_DEFAULT);
  EXPECT_GE(data, 0) << dataset;
  const hid_t space = H5Dget_space(data);
  std::vector<std::uint16_t> numbers(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
  EXPECT_GE(H5Dread(data, H5T_NATIVE_UINT16, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()), 0);
  H5Sclose(space);
  H5Dclose(data);
  H5Fclose(opened);
  return numbers;
}

TEST_F(Hdf5, LabelsAreDatasets) {
  const auto events = random_events(vga, 100'000, 3);
  std::vector<Label> labels;
  for (std::size_t i = 0; i < events.size(); ++i)
    labels.push_back({static_cast<std::uint16_t>(i), static_cast<Cause>(i % 6)});
  // Every third part has no labels.
  std::vector<std::uint16_t> causes(events.size());
  std::vector<std::uint16_t> classes(events.size());
  {
    Hdf5Writer writer(path(), {Hdf5Format::dsec, Compression::gzip, vga});
    for (std::size_t i = 0; i < events.size(); i += 777) {
      const auto size = std::min<std::size_t>(777, events.size() - i);
      if (i / 777 % 3 != 0) {
        writer.label(std::span(labels).subspan(i, size));
        for (std::size_t j = i; j < i + size; ++j) {
          causes[j] = static_cast<std::uint16_t>(labels[j].cause);
          classes[j] = labels[j].object_class;
        }
      }
      writer.append(std::span(events).subspan(i, size));
    }
  }
  EXPECT_TRUE(read_all(bytes_in(path())) == events);
  EXPECT_TRUE(numbers_in(path(), "events/cause") == causes);
  EXPECT_TRUE(numbers_in(path(), "events/class") == classes);
}

TEST_F(Hdf5, TriggersComeBack) {
  std::vector<Trigger> triggers;
  for (int i = 0; i < 40'000; ++i)
    triggers.push_back({i * 100, static_cast<std::uint16_t>(i % 3), i % 2 == 0});
  {
    Hdf5Writer writer(path(), metavision);
    writer.append(std::span<const Trigger>(triggers).first(100));
    writer.append(std::span<const Trigger>(triggers).subspan(100));
  }
  const Read read(bytes_in(path()));
  EXPECT_TRUE(read.contents.triggers == triggers);
  EXPECT_EQ(read.from(1'000'050).triggers.front().t, 1'000'100);
}

TEST_F(Hdf5, WhatALayoutCannotHoldIsRefused) {
  for (const auto& settings : {Settings{Hdf5Format::dsec, Compression::none, {}},
                               {Hdf5Format::metavision, Compression::none, {2049, 480}}})
    EXPECT_THROW(Hdf5Writer(path(), settings), std::invalid_argument);
  EXPECT_THROW(Hdf5Writer("/nowhere/at/all.h5", metavision), std::runtime_error);
  for (const auto& settings : all_settings()) {
    Hdf5Writer writer(path(), settings);
    writer.append(Events{AbsoluteEvent::at(1, 1, 100, Polarity::on)});
    for (const auto& event :
         {AbsoluteEvent::at(1, 1, 99, Polarity::on), AbsoluteEvent::at(640, 1, 100, Polarity::on),
          AbsoluteEvent::at(1, 480, 100, Polarity::on),
          AbsoluteEvent::at(1, 1, INT64_MAX, Polarity::on)})
      EXPECT_THROW(writer.append(Events{event}), std::invalid_argument);
  }
}

/// Makes writes fail beyond a file size limit, like a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t most) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit = {most, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_ = {};
  void (*handler_)(int) = nullptr;
};

/// A crash or a full disk costs a fifth of the events, or two chunks.
std::size_t min_kept(std::size_t events) {
  return events - std::min(events, std::max<std::size_t>(events / 5, 2 * 16384));
}

TEST_F(Hdf5, MostEventsSurviveAFullDisk) {
  const auto events = random_events(vga, 400'000, 21, 1'000'000);
  for (auto settings : all_settings()) {
    settings.commit_interval = std::chrono::hours(1);
    for (const rlim_t most : {0, 1000, 5000, 100'000, 300'000}) {
      std::size_t written = 0;
      try {
        const FileSizeLimit limit(most);
        Hdf5Writer writer(path(), settings);
        for (; written < events.size(); written += 1000)
          writer.append(std::span(events).subspan(written, 1000));
        ADD_FAILURE() << "nobody was told";
      } catch (const std::runtime_error& error) {
        EXPECT_NE(std::string(error.what()).find("File too large"), std::string::npos)
            << error.what();
      }
      if (min_kept(written) == 0) continue;
      const Read read(bytes_in(path()));
      const auto& left = read.contents.events;
      EXPECT_EQ(read.decoder->corruption().places, 0U);
      EXPECT_GE(left.size(), min_kept(written));
      EXPECT_TRUE(std::ranges::equal(left, std::span(events).first(left.size())));
    }
    EXPECT_TRUE(read_all(write(events, settings)) == events) << "the library still works";
  }
  EXPECT_EQ(H5Fget_obj_count(static_cast<hid_t>(H5F_OBJ_ALL), H5F_OBJ_FILE), 0);
}

/// Writes part of the events in a process that commits `commits` times, and is killed after more
/// events.
Events left_by_a_killed_process(const std::filesystem::path& file, const Settings& settings,
                                std::span<const AbsoluteEvent> events, std::size_t commits) {
  const pid_t child = fork();
  if (child == 0) {
    Hdf5Writer writer(file, settings);
    const auto part = events.size() / (commits + 1);
    for (std::size_t i = 0; i < commits; ++i, events = events.subspan(part)) {
      writer.append(events.first(part));
      writer.commit();
    }
    for (; events.size() > 1000; events = events.subspan(1000)) writer.append(events.first(1000));
    std::raise(SIGKILL);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status));
  const Read read(bytes_in(file));
  EXPECT_EQ(read.decoder->corruption().places, 0U);
  return read.contents.events;
}

TEST_F(Hdf5, WhatWasCommittedAndMostOfTheRestSurvivesTheProcess) {
  for (auto settings : all_settings()) {
    settings.commit_interval = std::chrono::hours(1);
    for (const std::size_t count : {3000, 60'000, 200'000}) {
      const auto events = random_events(vga, count, 21, 1'000'000);
      for (const std::size_t commits : {0, 1, 20}) {
        const auto left = left_by_a_killed_process(path(), settings, events, commits);
        EXPECT_GE(left.size(), std::max(min_kept(count), count / (commits + 1) * commits));
        EXPECT_TRUE(std::ranges::equal(left, std::span(events).first(left.size())));
      }
    }
  }
}

TEST_F(Hdf5, APauseOfADayHardlyTakesSpace) {
  auto events = random_events(vga, 1000, 1, 5, 1000);
  for (std::size_t i = 500; i < events.size(); ++i) events[i].t += 86'400'000'000;
  for (const auto& settings : all_settings()) {
    const auto file = write(events, settings);
    EXPECT_LT(file.size(), 5'000'000U);
    EXPECT_TRUE(read_all(file) == events);
  }
}

TEST_F(Hdf5, ComesBackWithAndWithoutCommits) {
  // Of some hours, whose microseconds need more than 32 bits.
  const auto events = random_events(vga, 200'000, 22, 1'000'000, 300'000'000);
  ASSERT_GT(events.back().t, std::int64_t{1} << 33);
  for (const auto& settings : all_settings()) {
    for (const bool commits : {false, true}) {
      {
        Hdf5Writer writer(path(), settings);
        for (auto rest = std::span(events); !rest.empty();) {
          const auto part = rest.first(std::min<std::size_t>(rest.size(), 7777));
          writer.append(part);
          if (commits) writer.commit();
          rest = rest.subspan(part.size());
        }
      }
      const Read read(bytes_in(path()));
      EXPECT_EQ(read.decoder->streams().front().size, vga);
      EXPECT_EQ(read.decoder->last_time(), events.back().t);
      EXPECT_TRUE(read.contents.events == events);
      EXPECT_EQ(read.decoder->corruption().places + read.decoder->corruption().outside, 0U);
      EXPECT_EQ(read.from(events[150'000].t).events.front().t, events[150'000].t);
    }
  }
}

TEST_F(Hdf5, WithoutCommitsTheSameEventsMakeTheSameBytes) {
  const auto events = random_events(vga, 50'000, 24, 1'000'000);
  std::vector<Bytes> files;
  for (int i = 0; i < 2; ++i) {
    for (auto settings : all_settings()) {
      settings.commit_interval = {};
      files.push_back(write(events, settings));
    }
    // HDF5 stores times in whole seconds.
    std::this_thread::sleep_for(std::chrono::milliseconds(i == 0 ? 1100 : 0));
  }
  EXPECT_TRUE(std::equal(files.begin(), files.begin() + 3, files.begin() + 3));
}

TEST_F(Hdf5, WhatIsNoFileOfEventsIsRefused) {
  for (const auto* const text : {"t,x,y,p\n", "\x89HDF\r\n\x1a\n", ""})
    EXPECT_NE(refusal(*make_hdf5_decoder(), bytes_of(text)), "");
}

TEST_F(Hdf5, CorruptChunksAreLeftOutAndCounted) {
  const auto events = random_events(vga, 60'000, 2, 5);
  const auto file = write(events, metavision);
  // Header of the third chunk: number of events and first time.
  std::uint32_t count = 16384 << 2;
  Bytes head(12);
  std::memcpy(head.data() + 4, &events[16384 * 2].t, 8);
  auto at = file.end();
  for (std::uint32_t packing = 0; packing < 3 && at == file.end(); ++packing) {
    const std::uint32_t word = count | packing;
    std::memcpy(head.data(), &word, 4);
    at = std::search(file.begin(), file.end(), head.begin(), head.end());
  }
  ASSERT_NE(at, file.end());
  auto corrupt = file;
  corrupt[static_cast<std::size_t>(at - file.begin()) + 3] = 0xff;
  const Read read(corrupt);
  auto expected = events;
  expected.erase(expected.begin() + 16384 * 2, expected.begin() + 16384 * 3);
  EXPECT_TRUE(read.contents.events == expected);
  EXPECT_EQ(read.decoder->corruption().places, 1U);
  EXPECT_EQ(read.decoder->corruption().first_at, static_cast<std::uint64_t>(at - file.begin()));
}

TEST_F(Hdf5, ASizeThatNoSensorHasIsNone) {
  auto bytes = write(random_events({4, 4}, 10, 1), metavision);
  constexpr std::string_view size = "640x480";
  constexpr std::string_view none = "65537x9";
  const auto found = std::search(bytes.begin(), bytes.end(), size.begin(), size.end());
  ASSERT_NE(found, bytes.end());
  std::ranges::copy(none, found);
  EXPECT_EQ(Read(bytes).decoder->streams().front().size, SensorSize{});
}

TEST_F(Hdf5, FiltersAreUndone) {
  // Literal bytes, a short copy that overlaps itself, and a long one.
  const Bytes packed = {2, 1, 2, 3, 2 << 5, 0, 7 << 5, 3, 6};
  const Bytes plain = {1, 2, 3, 3, 3, 3, 3, 1, 2, 3, 3, 3, 3, 3, 1, 2, 3, 3, 3};
  const int filters[] = {lzf_filter};
  auto bytes = packed;
  EXPECT_TRUE(undo_hdf5_filters(filters, 0, 1, plain.size(), bytes));
  EXPECT_EQ(bytes, plain);
  for (std::size_t length = 0; length < packed.size(); ++length) {
    Bytes cut(packed.begin(), packed.begin() + static_cast<std::ptrdiff_t>(length));
    EXPECT_FALSE(undo_hdf5_filters(filters, 0, 1, plain.size(), cut)) << length;
  }
  for (Bytes bad : {Bytes{0, 1, 1 << 5, 1}, Bytes{1 << 5, 0}, Bytes{31, 1}}) {
    EXPECT_FALSE(undo_hdf5_filters(filters, 0, 1, 100, bad));
  }
  // Less than a number cannot have been shuffled.
  constexpr int shuffle[] = {H5Z_FILTER_SHUFFLE};
  for (const std::size_t size : {0, 1, 3}) {
    Bytes few(size, 7);
    EXPECT_FALSE(undo_hdf5_filters(shuffle, 0, 4, 16, few));
  }
  auto longer = packed;
  EXPECT_FALSE(undo_hdf5_filters(filters, 0, 1, plain.size() - 6, longer));
}

TEST_F(Hdf5, FilesAreReadAndWrittenByThreads) {
  std::vector<std::thread> threads;
  std::array<bool, 4> equal{};
  for (std::size_t i = 0; i < equal.size(); ++i) {
    threads.emplace_back([&, i] {
      const auto events = random_events(vga, 100'000, static_cast<unsigned>(i));
      const auto file = path(std::to_string(i));
      {
        Hdf5Writer writer(file, all_settings()[i % 3]);
        for (std::size_t j = 0; j < events.size(); j += 1000)
          writer.append(std::span(events).subspan(j, 1000));
      }
      equal[i] = read_all(bytes_in(file)) == events;
    });
  }
  for (auto& thread : threads) thread.join();
  for (const bool same : equal) EXPECT_TRUE(same);
}

Bytes encoded_chunk(const Events& events) {
  Bytes chunk;
  encode_ecf(events, chunk);
  EXPECT_LE(chunk.size(), ecf_max_bytes(events.size()));
  return chunk;
}

void expect_comes_back(const Events& events) {
  Events out = {AbsoluteEvent::at(1, 2, 3, Polarity::on)};
  const auto before = out.front();
  ASSERT_TRUE(decode_ecf(encoded_chunk(events), out));
  EXPECT_EQ(out.front(), before);
  out.erase(out.begin());
  EXPECT_TRUE(out == events) << events.size();
}

TEST(Ecf, ChunkByteByByte) {
  // Two events of one row, then one 1000 us later in another: runs of y, masks of x, runs of p.
  const Events events = {AbsoluteEvent::at(5, 9, 100, Polarity::on),
                         AbsoluteEvent::at(7, 9, 100, Polarity::on),
                         AbsoluteEvent::at(3, 9, 1100, Polarity::off)};
  using namespace std::string_view_literals;
  const auto expected = bytes_of(
      "\x0c\0\0\0"          // three events, nothing packed,
      "\x64\0\0\0\0\0\0\0"  // from 100 us on
      "\x02"                // no later, two events
      "\xf8\xfe\xf3\x01"    // 0x3e8 us later, one event
      "\x23\x01"            // three in row 9
      "\xa8\0\x60\0"        // x = 5 and 5 + 2, x = 3
      "\x82\x01"sv);        // two ON, one OFF
  EXPECT_EQ(encoded_chunk(events), expected);
  expect_comes_back(events);
}

TEST(Ecf, PackedChunksByteByByte) {
  // Rows that differ: v = y << 12 | x << 1 | p of four events in three words.
  Events events = {AbsoluteEvent::at(0x123, 0x456, 0, Polarity::on),
                   AbsoluteEvent::at(0x321, 0x654, 0, Polarity::off),
                   AbsoluteEvent::at(0x7ff, 0x7fe, 0, Polarity::on),
                   AbsoluteEvent::at(0, 1, 0, Polarity::off)};
  auto chunk = encoded_chunk(events);
  ASSERT_EQ(chunk.size(), 12U + 1 + 12);
  EXPECT_EQ(chunk[0], 4 << 2 | 2);
  const std::uint32_t v[] = {0x456247, 0x654642, 0x7fefff, 0x1000};
  std::uint32_t words[3];
  std::memcpy(words, chunk.data() + 13, sizeof words);
  EXPECT_EQ(words[0], v[0] << 8 | (v[1] & 0xff));
  EXPECT_EQ(words[1], (v[1] >> 8) << 16 | (v[2] & 0xffff));
  EXPECT_EQ(words[2], (v[2] >> 16) << 24 | v[3]);
  expect_comes_back(events);

  // One row with x that fall: v = x << 1 | p.
  for (auto& event : events) event.y_p = static_cast<std::uint16_t>((event.y_p & 0x8000) | 5);
  events[1].x = 0x100;
  events[2].x = 0x0ff;
  chunk = encoded_chunk(events);
  ASSERT_EQ(chunk.size(), 12U + 1 + 2 + 6);
  EXPECT_EQ(chunk[0], 4 << 2 | 1);
  const unsigned u[] = {0x247, 0x200, 0x1ff, 0};
  std::uint16_t halves[3];
  std::memcpy(halves, chunk.data() + 15, sizeof halves);
  EXPECT_EQ(halves[0], u[0] << 4 | (u[1] & 0xf));
  EXPECT_EQ(halves[1], ((u[1] >> 4) << 8 | (u[2] & 0xff)) & 0xffff);
  EXPECT_EQ(halves[2], ((u[2] >> 8) << 12 | u[3]) & 0xffff);
  expect_comes_back(events);
}

TEST(Ecf, ComesBack) {
  for (const SensorSize size : {SensorSize{1, 1}, {2, 3}, {640, 480}, {2048, 2048}})
    for (unsigned seed = 0; seed < 60; ++seed)
      expect_comes_back(random_events(size, seed < 40 ? seed : seed * seed * 10, seed));
  expect_comes_back(random_events({2048, 2048}, ecf_max_events, 1, -5'000'000'000));
  // Runs at and around the lengths at which the encoding changes.
  for (const std::size_t count : {14, 15, 16, 30, 31, 32, 126, 127, 128, 65534, 65535})
    expect_comes_back(Events(count, AbsoluteEvent::at(2047, 2047, 1LL << 62, Polarity::on)));
}

TEST(Ecf, OtherWritersGoOnBehindTheLastEvent) {
  auto chunk = encoded_chunk({AbsoluteEvent::at(5, 9, 100, Polarity::on),
                              AbsoluteEvent::at(7, 9, 100, Polarity::on),
                              AbsoluteEvent::at(3, 9, 1100, Polarity::off)});
  chunk[21] |= 31;  // the last mask
  Events out;
  ASSERT_TRUE(decode_ecf(chunk, out));
  EXPECT_EQ(out.size(), 3U);
  EXPECT_EQ(out[2].x, 3);
}

TEST(Ecf, CorruptChunksAreRefused) {
  const auto events = random_events({640, 480}, 500, 3);
  const auto chunk = encoded_chunk(events);
  Events out;
  for (std::size_t size = 0; size < chunk.size(); ++size) {
    EXPECT_FALSE(decode_ecf(std::span(chunk).first(size), out)) << size;
    EXPECT_TRUE(out.empty());
  }
  // More events than a chunk can have, a run longer than the chunk, a time of more than 64 bits.
  EXPECT_FALSE(decode_ecf(Bytes{0, 0, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3}, out));
  Bytes run = {4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2};
  run.resize(100);
  EXPECT_FALSE(decode_ecf(run, out));
  Bytes endless = {4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  endless.resize(100, 0xff);
  EXPECT_FALSE(decode_ecf(endless, out));
}

}  // namespace
