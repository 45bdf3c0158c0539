// SPDX-License-Identifier: LGPL-2.1-or-later
// What our encoders of NumPy arrays and archives write, and hostile archives. other_readers.py
// holds both against NumPy.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cstdlib>
#include <filesystem>
#include <map>

#include "src/formats/numpy/npy_decoder.hpp"
#include "src/formats/numpy/npy_encoder.hpp"
#include "src/formats/numpy/npz.hpp"
#include "src/formats/numpy/zip_archive.hpp"
#include "src/formats/temporary_file.hpp"
#include "tests/formats/npz_file.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace recordings;
using npz_file::archive;

struct Read {
  explicit Read(const Bytes& bytes) : contents(decode(*decoder, bytes)) {}

  std::unique_ptr<Decoder> decoder = make_npz_decoder();
  Contents contents;
};

Events events_of(std::size_t count) {
  Events events;
  for (std::size_t i = 0; i < count; ++i)
    events.push_back(AbsoluteEvent::at(static_cast<int>(i % 640), static_cast<int>(i * 7 % 480),
                                       static_cast<Microseconds>(i * 3),
                                       i % 3 == 0 ? Polarity::on : Polarity::off));
  return events;
}

TEST(NpyEncoder, ComesBackWithAndWithoutThePatch) {
  const auto events = random_events({640, 480}, 50'000, 1, -1000);
  NpyEncoder encoder;
  const auto unpatched = encode(encoder, events, 17);
  EXPECT_EQ((unpatched.size() - events.size() * NpyEncoder::event_bytes) % 64, 0U);
  auto patched = unpatched;
  apply_patch(encoder, patched);
  for (const auto& bytes : {unpatched, patched})
    EXPECT_TRUE(events_however_split([] { return make_npy_decoder(); }, bytes) == events);
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
      const Read read(bytes);
      EXPECT_TRUE(read.contents.events == events) << count;
      EXPECT_EQ(read.decoder->streams().front().size, size);
      EXPECT_EQ(read.decoder->corruption().places + read.decoder->corruption().outside, 0U);
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

/// A flipped bit in the size is not another size.
TEST(Npz, ChecksTheSensorSize) {
  const auto bytes = written(*make_npz_encoder({640, 480}), events_of(20));
  auto flipped = bytes;
  const auto at = flipped.begin() + 30 + 9 + 20 + 128;
  ASSERT_EQ(*at, 640 & 0xff);
  *at ^= 1;
  const Read read(flipped);
  EXPECT_EQ(read.decoder->streams().front().size, SensorSize{});
  EXPECT_EQ(read.contents.events.size(), 20U);
  EXPECT_EQ(read.decoder->corruption().places, 1U);
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
  std::vector<npz_file::Member> bomb;
  for (const std::string name : {"t.npy", "x.npy", "y.npy", "p.npy"})
    bomb.push_back({name, npz_file::column("<i8", std::vector<std::int64_t>(1'000'000))});
  MemoryBytes source(archive(bomb, true));
  EXPECT_LT(source.size(), 100'000U);
  const auto reader = make_npz_decoder();
  reader->open(source);
  while (const auto item = reader->next())
    EXPECT_LE(std::get<EventItem>(*item).events.size(), 65'536U);
}

}  // namespace
