// SPDX-License-Identifier: LGPL-2.1-or-later
#include <hdf5.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <thread>

#include "src/core/byte_order.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/hdf5/hdf5_filters.hpp"
#include "src/formats/hdf5/hdf5_reader.hpp"
#include "src/formats/hdf5/hdf5_writer.hpp"
#include "tests/formats/table_events.hpp"
#include "tests/fuzz/small_hdf5.hpp"

namespace {

using namespace table_events;

using Events = std::vector<AbsoluteEvent>;
using Compression = Hdf5Writer::Compression;
using Settings = Hdf5Writer::Settings;

Bytes contents(const std::filesystem::path& file) {
  Bytes bytes(std::filesystem::file_size(file));
  std::ifstream(file, std::ios::binary)
      .read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  return bytes;
}

std::unique_ptr<ByteSource> in_memory(Bytes file) {
  return std::make_unique<MemoryBytes>(std::move(file));
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

  std::filesystem::path write(std::span<const AbsoluteEvent> events, const Settings& settings,
                              std::size_t at_once = 5000) const {
    Hdf5Writer writer(path(), settings);
    while (!events.empty()) {
      const auto part = events.first(std::min(at_once, events.size()));
      writer.append(part);
      events = events.subspan(part.size());
    }
    writer.close();
    return path();
  }

 private:
  std::filesystem::path folder_;
};

std::vector<Settings> all_settings(SensorSize size) {
  return {{Hdf5Format::dsec, Compression::none, size},
          {Hdf5Format::dsec, Compression::gzip, size},
          {Hdf5Format::metavision, Compression::none, size}};
}

Events read_all(Hdf5Reader& reader, std::size_t at_once = 10'000) {
  Events events;
  while (reader.read(at_once, events) > 0) {
  }
  return events;
}

TEST_F(Hdf5, ComesBack) {
  for (const auto size : sizes()) {
    for (const auto& settings : all_settings(size)) {
      const auto events =
          random_events(40'000, size, static_cast<unsigned>(size.height), 1'000'000);
      for (const std::size_t at_once : {777, 1'000'000}) {
        Hdf5Reader reader(in_memory(contents(write(events, settings, at_once))));
        EXPECT_EQ(reader.size(), size);
        ASSERT_TRUE(reader.time_range());
        EXPECT_EQ(reader.time_range()->first, events.front().t);
        EXPECT_EQ(reader.time_range()->last, events.back().t);
        EXPECT_TRUE(read_all(reader, at_once) == events);
        EXPECT_EQ(reader.corruption().places + reader.corruption().outside, 0U);
      }
      const auto other = random_events(100, size, 1);
      Hdf5Reader reader(in_memory(contents(path())));
      Hdf5Reader other_reader(in_memory(contents(write(other, settings))));
      EXPECT_TRUE(read_all(reader) == events);
      EXPECT_TRUE(read_all(other_reader) == other);
    }
  }
}

/// All numbers of a dataset.
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
  const auto events = std::vector(random_events(100'000, {640, 480}, 3));
  std::vector<Label> labels;
  for (std::size_t i = 0; i < events.size(); ++i)
    labels.push_back({static_cast<std::uint16_t>(i), static_cast<Cause>(i % 6)});
  for (const auto& settings : all_settings({640, 480})) {
    auto writer = std::make_unique<Hdf5Writer>(path(), settings);
    // Every third part has no labels.
    std::vector<std::uint16_t> causes;
    std::vector<std::uint16_t> classes;
    for (std::size_t i = 0; i < events.size(); i += 777) {
      const auto size = std::min<std::size_t>(777, events.size() - i);
      const bool is_labelled = i / 777 % 3 != 0;
      if (is_labelled) writer->label(std::span(labels).subspan(i, size));
      writer->append(std::span(events).subspan(i, size));
      for (std::size_t j = i; j < i + size; ++j) {
        causes.push_back(is_labelled ? static_cast<std::uint16_t>(labels[j].cause) : 0);
        classes.push_back(is_labelled ? labels[j].object_class : 0);
      }
    }
    writer.reset();
    Hdf5Reader reader(in_memory(contents(path())));
    EXPECT_TRUE(read_all(reader) == events);
    if (settings.format != Hdf5Format::dsec) continue;
    EXPECT_TRUE(numbers_in(path(), "events/cause") == causes);
    EXPECT_TRUE(numbers_in(path(), "events/class") == classes);
  }
}

void write_numbers(hid_t file, const char* name, std::vector<hsize_t> extent,
                   const std::vector<std::uint32_t>& numbers) {
  const hid_t space = H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr);
  const hid_t creation = H5Pcreate(H5P_LINK_CREATE);
  H5Pset_create_intermediate_group(creation, 1);
  const hid_t data =
      H5Dcreate2(file, name, H5T_STD_U32LE, space, creation, H5P_DEFAULT, H5P_DEFAULT);
  EXPECT_GE(H5Dwrite(data, H5T_NATIVE_UINT32, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()), 0);
  H5Dclose(data);
  H5Pclose(creation);
  H5Sclose(space);
}

/// Writes events with times of 32 bits as columns, or as the rows of v2e.
void write_wrapping(const std::filesystem::path& path, const Events& events, bool of_v2e) {
  std::vector<std::uint32_t> columns[4];
  std::vector<std::uint32_t> rows;
  for (const auto& event : events) {
    const std::array<std::uint32_t, 4> numbers{static_cast<std::uint32_t>(event.t), event.x,
                                               static_cast<std::uint32_t>(event.y()),
                                               event.polarity() == Polarity::on ? 1U : 0U};
    for (std::size_t column = 0; column < 4; ++column) columns[column].push_back(numbers[column]);
    rows.insert(rows.end(), numbers.begin(), numbers.end());
  }
  const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  constexpr const char* names[] = {"events/t", "events/x", "events/y", "events/p"};
  if (of_v2e)
    write_numbers(file, "events", {events.size(), 4}, rows);
  else
    for (std::size_t column = 0; column < 4; ++column)
      write_numbers(file, names[column], {events.size()}, columns[column]);
  H5Fclose(file);
}

TEST_F(Hdf5, TimesOf32BitsWrapWithoutAnIndex) {
  constexpr std::size_t count = 30'000;
  constexpr Microseconds step = 500'000;  // four hours: three wraps
  Events events;
  for (std::size_t i = 0; i < count; ++i)
    events.push_back(AbsoluteEvent::at(static_cast<int>(i % 300), static_cast<int>(i % 200),
                                       static_cast<Microseconds>(i) * step,
                                       i % 2 == 0 ? Polarity::off : Polarity::on));
  for (const bool of_v2e : {false, true}) {
    write_wrapping(path(), events, of_v2e);
    Hdf5Reader reader(in_memory(contents(path())));
    ASSERT_TRUE(reader.time_range());
    EXPECT_EQ(reader.time_range()->first, 0);
    EXPECT_EQ(reader.time_range()->last, events.back().t);
    EXPECT_TRUE(read_all(reader) == events);
    for (const std::size_t first : {29'999U, 8'589U, 8'590U, 8'591U, 20'000U, 100U, 0U}) {
      reader.seek(events[first].t);
      const auto found = read_all(reader);
      EXPECT_TRUE(std::ranges::equal(found, std::span(events).subspan(first))) << first;
    }
  }
}

TEST_F(Hdf5, KeepsDisorderAcrossAWrap) {
  constexpr auto lap = Microseconds{1} << 32;
  Events events;
  for (const auto t :
       {lap - 1, lap + 2, lap - 2, lap + 3, lap - 0x10000, lap - 0xffff, lap + 4, lap + 5, lap - 3})
    events.push_back(AbsoluteEvent::at(1, 2, t, Polarity::on));
  const auto expect_all = [&] {
    Hdf5Reader reader(in_memory(contents(path())));
    EXPECT_EQ(read_all(reader), events);
    ASSERT_TRUE(reader.time_range());
    EXPECT_EQ(reader.time_range()->last, lap - 3);
    reader.seek(lap + 5);
    EXPECT_EQ(read_all(reader), Events(events.end() - 2, events.end()));
  };
  write_wrapping(path(), events, true);
  expect_all();
  write_wrapping(path(), events, false);
  expect_all();
  // The first event at or after each millisecond.
  std::vector<std::uint32_t> index(lap / 1000 + 1);
  index.push_back(static_cast<std::uint32_t>(events.size()));
  const hid_t file = H5Fopen(path().c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  write_numbers(file, "ms_to_idx", {index.size()}, index);
  H5Fclose(file);
  expect_all();
}

TEST_F(Hdf5, TriggersComeBack) {
  std::vector<Trigger> triggers;
  for (int i = 0; i < 40'000; ++i)
    triggers.push_back({i * 100, static_cast<std::uint16_t>(i % 3), i % 2 == 0});
  {
    Hdf5Writer writer(path(), {Hdf5Format::metavision, Compression::none, {640, 480}});
    writer.append(std::span<const Trigger>(triggers).first(100));
    writer.append(std::span<const Trigger>(triggers).subspan(100));
  }
  Hdf5Reader reader(in_memory(contents(path())));
  std::vector<Trigger> found;
  while (reader.read_triggers(777, found) > 0) {
  }
  EXPECT_TRUE(found == triggers);
  reader.seek(1'000'050);
  found.clear();
  EXPECT_EQ(reader.read_triggers(1, found), 1U);
  EXPECT_EQ(found.front().t, 1'000'100);
}

TEST_F(Hdf5, WhatALayoutCannotHoldIsRefused) {
  const Settings dsec = {Hdf5Format::dsec, Compression::none, {640, 480}};
  EXPECT_THROW(Hdf5Writer(path(), {Hdf5Format::v2e, Compression::none, {640, 480}}),
               std::invalid_argument);
  EXPECT_THROW(Hdf5Writer(path(), {Hdf5Format::dsec, Compression::none, {}}),
               std::invalid_argument);
  EXPECT_THROW(Hdf5Writer(path(), {Hdf5Format::metavision, Compression::none, {2049, 480}}),
               std::invalid_argument);
  EXPECT_THROW(Hdf5Writer("/nowhere/at/all.h5", dsec), std::runtime_error);
  for (const auto& settings : all_settings({640, 480})) {
    Hdf5Writer writer(path(), settings);
    writer.append(Events{AbsoluteEvent::at(1, 1, 100, Polarity::on)});
    EXPECT_THROW(writer.append(Events{AbsoluteEvent::at(1, 1, 99, Polarity::on)}),
                 std::invalid_argument);
    EXPECT_THROW(writer.append(Events{AbsoluteEvent::at(640, 1, 100, Polarity::on)}),
                 std::invalid_argument);
    EXPECT_THROW(writer.append(Events{AbsoluteEvent::at(1, 480, 100, Polarity::on)}),
                 std::invalid_argument);
    EXPECT_THROW(writer.append(Events{AbsoluteEvent::at(1, 1, INT64_MAX, Polarity::on)}),
                 std::invalid_argument);
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

TEST_F(Hdf5, AFullDiskIsToldAndSurvived) {
  const auto events = random_events(150'000, {640, 480}, 5);
  for (const auto& settings : all_settings({640, 480})) {
    for (const rlim_t most : {0, 1000, 5000, 100'000, 300'000}) {
      const FileSizeLimit limit(most);
      try {
        write(events, settings);
        ADD_FAILURE() << "nobody was told";
      } catch (const std::runtime_error& error) {
        EXPECT_NE(std::string(error.what()).find("cannot be written: File too large"),
                  std::string::npos)
            << error.what();
      }
    }
    // The library still works.
    Hdf5Reader reader(in_memory(contents(write(events, settings))));
    EXPECT_TRUE(read_all(reader) == events);
  }
  EXPECT_EQ(H5Fget_obj_count(static_cast<hid_t>(H5F_OBJ_ALL), H5F_OBJ_FILE), 0);
}

/// Writes part of the events in a process that commits `commits` times, and is killed after more
/// events.
Events left_by_a_killed_process(const std::filesystem::path& file, const Settings& settings,
                                std::span<const AbsoluteEvent> events, int commits) {
  const pid_t child = fork();
  if (child == 0) {
    Hdf5Writer writer(file, settings);
    const auto part = events.size() / static_cast<std::size_t>(commits + 1);
    for (int i = 0; i < commits; ++i) {
      writer.append(events.first(part));
      events = events.subspan(part);
      writer.commit();
    }
    for (; events.size() > 1000; events = events.subspan(1000)) writer.append(events.first(1000));
    std::raise(SIGKILL);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status));
  Hdf5Reader reader(in_memory(contents(file)));
  EXPECT_EQ(reader.corruption().places, 0U);
  return read_all(reader);
}

TEST_F(Hdf5, WhatWasCommittedSurvivesTheProcess) {
  for (const auto& settings : all_settings({640, 480})) {
    for (const std::size_t count : {3000, 60'000}) {
      const auto events = random_events(count, settings.size, 21, 1'000'000);
      for (const int commits : {1, 20}) {
        const auto left = left_by_a_killed_process(path(), settings, events, commits);
        EXPECT_GE(left.size(), count / static_cast<std::size_t>(commits + 1) *
                                   static_cast<std::size_t>(commits));
        EXPECT_TRUE(std::ranges::equal(left, std::span(events).first(left.size())));
      }
    }
  }
}

/// A crash or a full disk costs a fifth of the events, or two chunks.
std::size_t min_kept(std::size_t events) {
  return events - std::min(events, std::max<std::size_t>(events / 5, 2 * 16384));
}

/// Events that come faster than the time between commits.
TEST_F(Hdf5, MostEventsSurviveTheProcess) {
  for (auto settings : all_settings({640, 480})) {
    settings.commit_interval = std::chrono::hours(1);
    for (const std::size_t count : {60'000, 200'000}) {
      const auto events = random_events(count, settings.size, 21, 1'000'000);
      const auto left = left_by_a_killed_process(path(), settings, events, 0);
      EXPECT_GE(left.size(), min_kept(count));
      EXPECT_TRUE(std::ranges::equal(left, std::span(events).first(left.size())));
    }
  }
}

TEST_F(Hdf5, MostEventsSurviveAFullDisk) {
  const auto events = random_events(400'000, {640, 480}, 21, 1'000'000);
  for (auto settings : all_settings({640, 480})) {
    settings.commit_interval = std::chrono::hours(1);
    for (const rlim_t most : {300'000, 1'000'000}) {
      std::size_t written = 0;
      {
        const FileSizeLimit limit(most);
        Hdf5Writer writer(path(), settings);
        EXPECT_THROW(for (; written < events.size(); written += 1000)
                         writer.append(std::span(events).subspan(written, 1000)),
                     std::system_error);
      }
      Hdf5Reader reader(in_memory(contents(path())));
      const auto left = read_all(reader);
      EXPECT_EQ(reader.corruption().places, 0U);
      EXPECT_GE(left.size(), min_kept(written));
      EXPECT_TRUE(std::ranges::equal(left, std::span(events).first(left.size())));
    }
  }
}

TEST_F(Hdf5, APauseOfADayHardlyTakesSpace) {
  auto events = random_events(1000, {640, 480}, 1, 5);
  for (std::size_t i = 500; i < events.size(); ++i) events[i].t += 86'400'000'000;
  for (const auto& settings : all_settings({640, 480})) {
    const auto file = contents(write(events, settings));
    EXPECT_LT(file.size(), 5'000'000U);
    Hdf5Reader reader(in_memory(file));
    EXPECT_TRUE(read_all(reader) == events);
  }
}

TEST_F(Hdf5, WhatIsCompressedTwiceIsRefused) {
  fuzz::SmallHdf5 file("twice");
  file.group("events");
  constexpr hsize_t rows = 1 << 16;
  const std::vector<std::uint64_t> zeros(rows);
  for (const auto* const name : {"events/p", "events/x", "events/y"})
    file.dataset(name, H5T_NATIVE_UINT64, {rows}, zeros.data());
  file.stored_dataset("events/t", H5T_NATIVE_UINT64, {rows}, rows,
                      {H5Z_FILTER_DEFLATE, H5Z_FILTER_DEFLATE}, {});
  try {
    Hdf5Reader reader(in_memory(file.bytes()));
    ADD_FAILURE() << "it was read";
  } catch (const UnsupportedFormat& error) {
    EXPECT_NE(std::string(error.what()).find("compressed more than once"), std::string::npos)
        << error.what();
  }
}

TEST_F(Hdf5, ChunksThatShareAnAddressAreRefused) {
  fuzz::SmallHdf5 file("shared");
  file.group("events");
  constexpr hsize_t rows = 1 << 16;
  constexpr hsize_t chunks = 30;
  const std::vector<std::uint8_t> zeros(rows * chunks);
  for (const auto* const name : {"events/p", "events/x", "events/y"})
    file.dataset(name, H5T_NATIVE_UINT8, {rows * chunks}, zeros.data());
  const Bytes large(400'000);
  const Bytes small(1);
  std::vector<std::span<const std::uint8_t>> stored(chunks, small);
  stored[0] = large;
  file.stored_dataset("events/t", H5T_NATIVE_UINT64, {rows * chunks}, rows, {H5Z_FILTER_DEFLATE},
                      stored);
  const auto refusal = [](const Bytes& bytes) -> std::string {
    try {
      Hdf5Reader reader(in_memory(bytes));
    } catch (const UnsupportedFormat& error) {
      return error.what();
    }
    return "none";
  };
  auto bytes = file.bytes();
  EXPECT_EQ(refusal(bytes), "none");
  // Nodes of chunk indexes: a header of 24 bytes with the number of chunks, then for each chunk its
  // size, filter mask and two offsets, and its address.
  constexpr std::string_view node = "TREE\1";
  constexpr std::size_t entry = 32;
  for (auto at = bytes.begin();; ++at) {
    at = std::search(at, bytes.end(), node.begin(), node.end());
    if (at == bytes.end()) break;
    auto* const first = &*at + 24;
    if (little_endian<std::uint32_t>(first) != large.size()) continue;
    for (std::size_t i = 1; i < at[6]; ++i) {
      std::copy_n(first, 4, first + i * entry);
      std::copy_n(first + 24, 8, first + i * entry + 24);
    }
  }
  const auto refused = refusal(bytes);
  EXPECT_NE(refused.find("has chunks that overlap"), std::string::npos) << refused;
}

TEST_F(Hdf5, CommitsDoNotChangeTheFile) {
  const auto events = random_events(200'000, {640, 480}, 22, 1'000'000);
  for (const auto& settings : all_settings({640, 480})) {
    {
      Hdf5Writer writer(path(), settings);
      for (auto rest = std::span(events); !rest.empty();) {
        const auto part = rest.first(std::min<std::size_t>(rest.size(), 7777));
        writer.append(part);
        writer.commit();
        rest = rest.subspan(part.size());
      }
    }
    Hdf5Reader reader(in_memory(contents(path())));
    EXPECT_TRUE(read_all(reader) == events);
    reader.seek(events[150'000].t);
    Events found;
    reader.read(1, found);
    EXPECT_EQ(found.front().t, events[150'000].t);
  }
}

TEST_F(Hdf5, WithoutCommitsTheSameEventsMakeTheSameBytes) {
  const auto events = random_events(50'000, {640, 480}, 24, 1'000'000);
  const auto written = [&] {
    std::vector<Bytes> files;
    for (auto settings : all_settings({640, 480})) {
      settings.commit_interval = {};
      files.push_back(contents(write(events, settings)));
    }
    return files;
  };
  const auto first = written();
  // HDF5 stores times in whole seconds.
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  EXPECT_TRUE(written() == first);
}

TEST_F(Hdf5, WhatIsNoFileOfEventsIsRefused) {
  EXPECT_THROW(Hdf5Reader reader(in_memory(bytes_of("t,x,y,p\n"))), UnsupportedFormat);
  EXPECT_THROW(Hdf5Reader reader(in_memory(bytes_of("\x89HDF\r\n\x1a\n"))), UnsupportedFormat);
  EXPECT_THROW(Hdf5Reader reader(in_memory({})), UnsupportedFormat);
}

TEST_F(Hdf5, CorruptChunksAreLeftOutAndCounted) {
  const auto events = random_events(60'000, {640, 480}, 2, 5);
  const auto file =
      contents(write(events, {Hdf5Format::metavision, Compression::none, {640, 480}}));
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
  Hdf5Reader reader(in_memory(corrupt));
  auto expected = events;
  expected.erase(expected.begin() + 16384 * 2, expected.begin() + 16384 * 3);
  EXPECT_TRUE(read_all(reader) == expected);
  EXPECT_EQ(reader.corruption().places, 1U);
  EXPECT_EQ(reader.corruption().first_at, static_cast<std::uint64_t>(at - file.begin()));
}

TEST_F(Hdf5, AChunkOfLessThanANumberIsCorrupt) {
  constexpr int shuffle[] = {H5Z_FILTER_SHUFFLE};
  for (const std::size_t size : {0, 1, 3}) {
    Bytes bytes(size, 7);
    EXPECT_FALSE(undo_hdf5_filters(shuffle, 0, 4, 16, bytes));
    EXPECT_EQ(bytes, Bytes(size, 7));
  }
}

TEST_F(Hdf5, ASizeThatNoSensorHasIsNone) {
  auto bytes = contents(
      write(random_events(10, {4, 4}, 1), {Hdf5Format::metavision, Compression::none, {640, 480}}));
  constexpr std::string_view size = "640x480";
  constexpr std::string_view none = "65537x9";
  const auto found = std::search(bytes.begin(), bytes.end(), size.begin(), size.end());
  ASSERT_NE(found, bytes.end());
  std::ranges::copy(none, found);
  Hdf5Reader reader(in_memory(bytes));
  EXPECT_EQ(reader.size(), SensorSize{});
}

/// Four events as several tools store them.
struct FourEvents {
  std::vector<std::int64_t> t = {100, 200, 1300, 1'000'400};
  std::vector<double> seconds = {1e-4, 2e-4, 13e-4, 1.0004};
  std::vector<std::int64_t> x = {10, 11, 12, 13};
  std::vector<std::int64_t> y = {20, 21, 22, 23};
  std::vector<std::int64_t> p = {1, 0, 1, 1};
  Events events = {AbsoluteEvent::at(10, 20, 100, Polarity::on),
                   AbsoluteEvent::at(11, 21, 200, Polarity::off),
                   AbsoluteEvent::at(12, 22, 1300, Polarity::on),
                   AbsoluteEvent::at(13, 23, 1'000'400, Polarity::on)};

  /// Adds columns with these names.
  void add(fuzz::SmallHdf5& file, const std::vector<std::string>& names) const {
    file.dataset(names[0].c_str(), H5T_NATIVE_INT64, {4}, t.data());
    add_others(file, names);
  }
  void add_in_seconds(fuzz::SmallHdf5& file, const std::vector<std::string>& names) const {
    file.dataset(names[0].c_str(), H5T_NATIVE_DOUBLE, {4}, seconds.data());
    add_others(file, names);
  }
  void add_others(fuzz::SmallHdf5& file, const std::vector<std::string>& names) const {
    file.dataset(names[1].c_str(), H5T_NATIVE_INT64, {4}, x.data());
    file.dataset(names[2].c_str(), H5T_NATIVE_INT64, {4}, y.data());
    file.dataset(names[3].c_str(), H5T_NATIVE_INT64, {4}, p.data());
  }
};

TEST_F(Hdf5, ColumnsAreFoundByTheirNames) {
  const FourEvents four;
  const std::vector<std::string> layouts[] = {
      {"t", "x", "y", "p"},
      {"events/ts", "events/xs", "events/ys", "events/ps"},
      {"events/timestamp", "events/x", "events/y", "events/polarity"},
      {"prophesee/left/t", "prophesee/left/x", "prophesee/left/y", "prophesee/left/p"}};
  for (const auto& names : layouts) {
    for (const bool in_seconds : {false, true}) {
      fuzz::SmallHdf5 file("columns");
      for (const auto* const group :
           {"events", "prophesee", "prophesee/left", "prophesee/right", "imu"})
        file.group(group);
      // Other numbers, and another camera.
      file.dataset("imu/t", H5T_NATIVE_INT64, {4}, four.t.data());
      file.dataset("imu/x", H5T_NATIVE_INT64, {4}, four.t.data());
      if (names[0].starts_with("prophesee"))
        four.add(file, {"prophesee/right/t", "prophesee/right/y", "prophesee/right/x",
                        "prophesee/right/p"});
      if (in_seconds)
        four.add_in_seconds(file, names);
      else
        four.add(file, names);
      Hdf5Reader reader(in_memory(file.bytes()));
      EXPECT_EQ(read_all(reader), four.events) << names[0];
      reader.seek(1300);
      EXPECT_EQ(read_all(reader).size(), 2U);
      ASSERT_TRUE(reader.time_range());
      EXPECT_EQ(reader.time_range()->last, 1'000'400);
    }
  }
  fuzz::SmallHdf5 file("nanoseconds");
  auto nanoseconds = four;
  for (auto& t : nanoseconds.t) t = t * 1000 + 7;
  nanoseconds.add(file, {"t_ns", "x", "y", "p"});
  Hdf5Reader reader(in_memory(file.bytes()));
  EXPECT_EQ(read_all(reader), four.events);
}

TEST_F(Hdf5, APathSelectsACamera) {
  const FourEvents left;
  auto right = left;
  for (auto& t : right.t) t += 5;
  fuzz::SmallHdf5 file("cameras");
  for (const auto* const group : {"left", "right", "other"}) file.group(group);
  left.add(file, {"left/t", "left/x", "left/y", "left/p"});
  right.add(file, {"right/t", "right/x", "right/y", "right/p"});
  const std::vector<std::int64_t> rows = {1, 10, 20, 1, 2, 11, 21, 0};
  file.dataset("other/events", H5T_NATIVE_INT64, {2, 4}, rows.data());
  file.dataset("other/event_numbers", H5T_NATIVE_INT64, {4}, left.t.data());
  const auto times = [&](const std::string& path) {
    Hdf5Reader reader(in_memory(file.bytes()), {.path = path});
    EXPECT_EQ(reader.others(), path.empty() ? "/other/events, /right" : "");
    const auto range = reader.time_range();
    return range ? range->last : -1;
  };
  EXPECT_EQ(times(""), left.t.back());
  EXPECT_EQ(times("left"), left.t.back());
  EXPECT_EQ(times("/right/"), right.t.back());
  EXPECT_EQ(times("other"), 2);
  EXPECT_EQ(times("other/events"), 2);
  try {
    times("middle");
    ADD_FAILURE() << "it was read";
  } catch (const UnsupportedFormat& error) {
    EXPECT_STREQ(error.what(),
                 "the HDF5 file has no events at events-path /middle; it has some at /left, "
                 "/other/events, /right");
  }
}

TEST_F(Hdf5, UnitAndColumnsMayBeSet) {
  const FourEvents four;
  auto nanoseconds = four;
  for (auto& t : nanoseconds.t) t = t * 1000 + 7;
  const TableSettings settings{.columns = *columns_of("pyxt"), .unit = TimeUnit::nanoseconds};
  fuzz::SmallHdf5 file("nanoseconds");
  nanoseconds.add(file, {"t", "x", "y", "p"});
  Hdf5Reader columns(in_memory(file.bytes()), {.table = settings});
  EXPECT_EQ(read_all(columns), four.events);
  std::vector<double> rows;
  for (std::size_t i = 0; i < 4; ++i)
    for (const auto* const column :
         {&nanoseconds.p, &nanoseconds.y, &nanoseconds.x, &nanoseconds.t})
      rows.push_back(static_cast<double>((*column)[i]));
  fuzz::SmallHdf5 other("rows");
  other.dataset("events", H5T_NATIVE_DOUBLE, {4, 4}, rows.data());
  Hdf5Reader reader(in_memory(other.bytes()), {.table = settings});
  EXPECT_EQ(read_all(reader), four.events);
}

TEST_F(Hdf5, RowsAreRecordsOrNumbers) {
  const FourEvents four;
  struct Record {
    std::uint16_t x, y;
    std::int16_t p;
    std::int64_t t;
  };
  std::vector<Record> records;
  std::vector<double> txyp, xytp;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto x = static_cast<std::uint16_t>(four.x[i]);
    const auto y = static_cast<std::uint16_t>(four.y[i]);
    records.push_back({x, y, static_cast<std::int16_t>(four.p[i]), four.t[i]});
    const auto p = four.p[i] == 1 ? 1.0 : -1.0;
    txyp.insert(txyp.end(), {four.seconds[i], static_cast<double>(x), static_cast<double>(y), p});
    xytp.insert(xytp.end(), {static_cast<double>(x), static_cast<double>(y), four.seconds[i], p});
  }
  fuzz::SmallHdf5 compound("compound");
  const Hdf5Handle type(H5Tcreate(H5T_COMPOUND, sizeof(Record)), H5Tclose);
  H5Tinsert(type.get(), "x", offsetof(Record, x), H5T_NATIVE_UINT16);
  H5Tinsert(type.get(), "y", offsetof(Record, y), H5T_NATIVE_UINT16);
  H5Tinsert(type.get(), "polarity", offsetof(Record, p), H5T_NATIVE_INT16);
  H5Tinsert(type.get(), "timestamp", offsetof(Record, t), H5T_NATIVE_INT64);
  compound.dataset("events", type.get(), {4}, records.data());
  Hdf5Reader compound_reader(in_memory(compound.bytes()));
  EXPECT_EQ(read_all(compound_reader), four.events);

  for (const auto& [path, numbers] :
       {std::pair{"events", &txyp}, {"events", &xytp}, {"davis/right/events", &xytp}}) {
    fuzz::SmallHdf5 file("rows");
    file.group("davis");
    file.group("davis/right");
    file.dataset(path, H5T_NATIVE_DOUBLE, {4, 4}, numbers->data());
    Hdf5Reader reader(in_memory(file.bytes()));
    EXPECT_EQ(read_all(reader), four.events) << path;
    EXPECT_EQ(reader.size(),
              std::string_view(path) == "events" ? SensorSize{} : (SensorSize{346, 260}));
  }
}

TEST_F(Hdf5, TheLargestUnsignedPolarityIsOff) {
  const std::vector<std::uint32_t> rows = {100, 10, 20, 1, 200, 11, 21, UINT32_MAX};
  fuzz::SmallHdf5 file("v2e");
  file.dataset("events", H5T_NATIVE_UINT32, {2, 4}, rows.data());
  Hdf5Reader reader(in_memory(file.bytes()));
  EXPECT_EQ(read_all(reader), (Events{AbsoluteEvent::at(10, 20, 100, Polarity::on),
                                      AbsoluteEvent::at(11, 21, 200, Polarity::off)}));
}

TEST_F(Hdf5, DoubtfulColumnsAreRefused) {
  const auto error_of = [](const FourEvents& events) -> std::string {
    fuzz::SmallHdf5 file("doubtful");
    events.add(file, {"t", "x", "y", "p"});
    try {
      Hdf5Reader reader(in_memory(file.bytes()));
    } catch (const UnsupportedFormat& error) {
      return error.what();
    }
    return "none";
  };
  FourEvents nanoseconds;
  for (auto& t : nanoseconds.t) t = t * 1000 + 7;
  EXPECT_NE(error_of(nanoseconds).find("time-unit"), std::string::npos);
  FourEvents polarities;
  polarities.p = {0, 1, 2, 3};
  EXPECT_NE(error_of(polarities).find("are 0 1 2 3;"), std::string::npos);
}

TEST_F(Hdf5, TheSizeMayBeAnAttributeOfTwoNumbers) {
  fuzz::SmallHdf5 file("size");
  FourEvents().add(file, {"t", "x", "y", "p"});
  const hsize_t two = 2;
  const std::int64_t height_and_width[] = {180, 240};
  {
    const Hdf5Handle space(H5Screate_simple(1, &two, nullptr), H5Sclose);
    const Hdf5Handle attribute(H5Acreate2(file.id(), "sensor_resolution", H5T_NATIVE_INT64,
                                          space.get(), H5P_DEFAULT, H5P_DEFAULT),
                               H5Aclose);
    H5Awrite(attribute.get(), H5T_NATIVE_INT64, height_and_width);
  }
  EXPECT_EQ(Hdf5Reader(in_memory(file.bytes())).size(), (SensorSize{240, 180}));
}

TEST_F(Hdf5, LzfIsUndone) {
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
  auto longer = packed;
  EXPECT_FALSE(undo_hdf5_filters(filters, 0, 1, plain.size() - 6, longer));
}

TEST_F(Hdf5, FilesAreReadAndWrittenByThreads) {
  std::vector<std::thread> threads;
  std::array<bool, 4> equal{};
  for (std::size_t i = 0; i < equal.size(); ++i) {
    threads.emplace_back([&, i] {
      const auto settings = all_settings({640, 480})[i % 3];
      const auto events = random_events(100'000, {640, 480}, static_cast<unsigned>(i));
      const auto file = path(std::to_string(i));
      {
        Hdf5Writer writer(file, settings);
        for (std::size_t j = 0; j < events.size(); j += 1000)
          writer.append(std::span(events).subspan(j, 1000));
      }
      Hdf5Reader reader(in_memory(contents(file)));
      equal[i] = read_all(reader, 1000) == events;
    });
  }
  for (auto& thread : threads) thread.join();
  for (const bool same : equal) EXPECT_TRUE(same);
}

}  // namespace
