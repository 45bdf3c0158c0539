// SPDX-License-Identifier: LGPL-2.1-or-later
// Files that gzip or zstd has compressed.
#include "src/formats/compressed_file.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <utility>

#include "src/formats/corruption.hpp"
#include "tests/formats/compressed.hpp"
#include "tests/formats/recordings.hpp"

namespace {

using namespace eventcamera;
using recordings::Bytes;

/// Bytes of which a half repeats.
Bytes content(std::size_t size) {
  std::mt19937 random(1);
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; i += 2) bytes[i] = static_cast<std::uint8_t>(random());
  return bytes;
}

Bytes decompressed(FileDecompressor& decompressor, std::span<const std::uint8_t> file,
                   std::size_t piece) {
  Bytes out;
  const auto add_all = [&] {
    for (auto part = decompressor.next(); !part.empty(); part = decompressor.next())
      out.insert(out.end(), part.begin(), part.end());
  };
  for (const auto part : recordings::pieces_of(file, piece)) {
    const Bytes copy(part.begin(), part.end());
    decompressor.push(copy);
    add_all();
  }
  decompressor.finish();
  add_all();
  return out;
}

struct Way {
  const char* name;
  Bytes (*compress)(std::span<const std::uint8_t>);
};

class CompressedFile : public testing::TestWithParam<Way> {};
INSTANTIATE_TEST_SUITE_P(, CompressedFile,
                         testing::Values(Way{"gzip", compressed::gzip},
                                         Way{"zstd", compressed::zstd}),
                         [](const auto& test) { return test.param.name; });

TEST_P(CompressedFile, IsDecompressedHoweverItIsSplit) {
  for (const std::size_t size : {0UL, 1UL, 1'000'000UL}) {
    const auto expected = content(size);
    const auto file = GetParam().compress(expected);
    for (const std::size_t piece : {1UL, 0UL, 1UL << 24}) {
      FileDecompressor decompressor;
      EXPECT_TRUE(decompressed(decompressor, file, piece) == expected);
      EXPECT_TRUE(decompressor.is_compressed());
      EXPECT_EQ(decompressor.corrupt_at(), std::nullopt);
    }
  }
}

TEST_P(CompressedFile, MayHaveSeveralParts) {
  auto expected = content(1000);
  const auto more = content(300'000);
  auto file = GetParam().compress(expected);
  std::ranges::copy(GetParam().compress(more), std::back_inserter(file));
  std::ranges::copy(more, std::back_inserter(expected));
  for (const std::size_t piece : {1UL, 1UL << 24}) {
    FileDecompressor decompressor;
    EXPECT_TRUE(decompressed(decompressor, file, piece) == expected);
    EXPECT_EQ(decompressor.corrupt_at(), std::nullopt);
  }
}

TEST_P(CompressedFile, IsReadUpToWhereItIsCorruptOrCut) {
  const auto expected = content(1'000'000);
  const auto file = GetParam().compress(expected);
  auto corrupt = file;
  for (auto i = file.size() / 2; i < file.size() / 2 + 100; ++i) corrupt[i] ^= 0x55;
  const Bytes cut(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(file.size() / 2));
  for (const auto& broken : {corrupt, cut}) {
    for (const std::size_t piece : {1000UL, 1UL << 24}) {
      FileDecompressor decompressor;
      const auto found = decompressed(decompressor, broken, piece);
      ASSERT_TRUE(decompressor.corrupt_at());
      EXPECT_LE(*decompressor.corrupt_at(), broken.size());
      const auto same = std::ranges::mismatch(found, expected).in1 - found.begin();
      EXPECT_GT(static_cast<std::size_t>(same), expected.size() / 4);
    }
  }
}

TEST_P(CompressedFile, HasALimitedSize) {
  const auto zeros = GetParam().compress(Bytes(std::size_t{1} << 24));
  Bytes file;
  for (int i = 0; i < 32; ++i) file.insert(file.end(), zeros.begin(), zeros.end());
  FileDecompressor decompressor;
  std::size_t size = 0;
  decompressor.push(file);
  const auto decompress = [&] {
    for (auto part = decompressor.next(); !part.empty(); part = decompressor.next())
      size += part.size();
  };
  EXPECT_THROW(decompress(), UnsupportedFormat);
  EXPECT_LT(size, std::size_t{1} << 29);
}

TEST_P(CompressedFile, IsASourceOfItsContent) {
  const auto expected = content(1'000'000);
  MemoryBytes compressed(GetParam().compress(expected));
  DecompressedFile file(compressed);
  ASSERT_TRUE(file.decompress());
  EXPECT_EQ(file.size(), expected.size());
  EXPECT_EQ(file.corrupt_at(), std::nullopt);
  for (const std::size_t position : {0UL, 700'000UL, 999'999UL, 1'000'000UL, 2'000'000UL}) {
    const auto rest = std::span(expected).subspan(std::min(position, expected.size()));
    const auto piece = file.piece(position);
    ASSERT_TRUE(piece);
    EXPECT_EQ(piece->empty(), rest.empty());
    EXPECT_TRUE(std::ranges::equal(*piece, rest.first(piece->size())));
    Bytes out(100);
    EXPECT_EQ(file.read(position, out), std::min<std::size_t>(100, rest.size()));
  }
}

TEST(FileDecompressor, IgnoresWhatFollowsAGzipFile) {
  const auto expected = content(1000);
  auto file = compressed::gzip(expected);
  file.resize(file.size() + 512);
  FileDecompressor decompressor;
  EXPECT_EQ(decompressed(decompressor, file, 1), expected);
  EXPECT_EQ(decompressor.corrupt_at(), std::nullopt);
}

TEST(FileDecompressor, ReturnsOtherFilesAsTheyAre) {
  const Bytes files[] = {{}, {0x1f}, {0x1f, 0x8b, 8}, {0x1f, 0x8b, 8, 0xff, 1}, content(100'000)};
  for (const auto& file : files) {
    for (const std::size_t piece : {1UL, 3UL, 1UL << 24}) {
      FileDecompressor decompressor;
      EXPECT_EQ(decompressed(decompressor, file, piece), file);
      EXPECT_FALSE(decompressor.is_compressed());
      EXPECT_EQ(decompressor.corrupt_at(), std::nullopt);
    }
  }
}

}  // namespace
