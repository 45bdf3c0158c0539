// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/compressed_file.hpp"

#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <limits>
#include <new>
#include <utility>

#include "src/formats/corruption.hpp"

namespace eventcamera {

namespace {

constexpr std::size_t block_size = std::size_t{1} << 18;
constexpr std::array<std::uint8_t, 3> gzip_magic{0x1f, 0x8b, 8};  // deflate, the only method
constexpr std::uint8_t gzip_reserved_flags = 0xe0;
constexpr std::array<std::uint8_t, 4> zstd_magic{0x28, 0xb5, 0x2f, 0xfd};

bool begins_with(std::span<const std::uint8_t> magic, std::span<const std::uint8_t> bytes) {
  return bytes.size() >= magic.size() && std::ranges::equal(bytes.first(magic.size()), magic);
}

bool begins_gzip(std::span<const std::uint8_t> start) {
  return start.size() > gzip_magic.size() && begins_with(gzip_magic, start) &&
         (start[gzip_magic.size()] & gzip_reserved_flags) == 0;
}

}  // namespace

/// One of the compressed formats.
class FileDecompressor::Codec {
 public:
  virtual ~Codec() = default;
  Codec(const Codec&) = delete;
  Codec& operator=(const Codec&) = delete;

  struct Result {
    std::size_t used = 0;    ///< bytes of the input
    std::size_t filled = 0;  ///< bytes of the output
    bool is_corrupt = false;
  };

  virtual Result decompress(std::span<const std::uint8_t> in, std::span<std::uint8_t> out) = 0;

  /// True if the file may end here: after a gzip member or a Zstandard frame.
  bool may_end() const { return may_end_; }

 protected:
  Codec() = default;

  bool may_end_ = false;
};

/// Members of a gzip file, one after the other. Anything that follows them is ignored, as gzip
/// does.
class FileDecompressor::Gzip final : public Codec {
 public:
  Gzip() {
    constexpr int only_gzip = 16;
    if (inflateInit2(&stream_, MAX_WBITS + only_gzip) != Z_OK) throw std::bad_alloc();
  }
  ~Gzip() override { inflateEnd(&stream_); }
  Gzip(const Gzip&) = delete;
  Gzip& operator=(const Gzip&) = delete;

  Result decompress(std::span<const std::uint8_t> in, std::span<std::uint8_t> out) override {
    if (may_end_ && in.empty()) return {};
    is_past_end_ |= may_end_ && in.front() != gzip_magic.front();
    if (is_past_end_) return {.used = in.size()};
    if (may_end_) inflateReset(&stream_);
    constexpr std::size_t max_in = std::numeric_limits<uInt>::max();
    stream_.next_in = const_cast<Bytef*>(in.data());  // NOLINT: zlib does not change its input
    stream_.avail_in = static_cast<uInt>(std::min(in.size(), max_in));
    stream_.next_out = out.data();
    stream_.avail_out = static_cast<uInt>(out.size());
    const auto result = inflate(&stream_, Z_NO_FLUSH);
    may_end_ = result == Z_STREAM_END;
    return {.used = static_cast<std::size_t>(stream_.next_in - in.data()),
            .filled = out.size() - stream_.avail_out,
            .is_corrupt = result != Z_OK && result != Z_STREAM_END && result != Z_BUF_ERROR};
  }

 private:
  z_stream stream_{};
  bool is_past_end_ = false;
};

/// Frames of a Zstandard file, of a window of up to 128 MiB.
class FileDecompressor::Zstd final : public Codec {
 public:
  Zstd() {
    if (!context_) throw std::bad_alloc();
  }

  Result decompress(std::span<const std::uint8_t> in, std::span<std::uint8_t> out) override {
    if (may_end_ && in.empty()) return {};
    ZSTD_inBuffer input{in.data(), in.size(), 0};
    ZSTD_outBuffer output{out.data(), out.size(), 0};
    const auto result = ZSTD_decompressStream(context_.get(), &output, &input);
    may_end_ = result == 0;
    return {.used = input.pos, .filled = output.pos, .is_corrupt = ZSTD_isError(result) != 0};
  }

 private:
  struct Deleter {
    void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
  };
  std::unique_ptr<ZSTD_DCtx, Deleter> context_{ZSTD_createDCtx()};
};

FileDecompressor::FileDecompressor() = default;
FileDecompressor::~FileDecompressor() = default;

bool FileDecompressor::is_compressed(std::span<const std::uint8_t> start) {
  return begins_gzip(start) || begins_with(zstd_magic, start);
}

std::unique_ptr<FileDecompressor::Codec> FileDecompressor::codec_of(
    std::span<const std::uint8_t> start) {
  if (begins_gzip(start)) return std::make_unique<Gzip>();
  if (begins_with(zstd_magic, start)) return std::make_unique<Zstd>();
  return nullptr;
}

std::span<const std::uint8_t> FileDecompressor::next() {
  if (!is_known_) {
    const auto count = std::min(piece_.size(), magic_size - start_.size());
    start_.insert(start_.end(), piece_.begin(),
                  piece_.begin() + static_cast<std::ptrdiff_t>(count));
    piece_ = piece_.subspan(count);
    if (start_.size() < magic_size && !is_finished_) return {};
    codec_ = codec_of(start_);
    is_known_ = true;
    if (!codec_ && !start_.empty()) return start_;
  }
  if (!codec_) return std::exchange(piece_, {});
  content_.resize(block_size);
  while (!corrupt_at_) {
    // The first bytes were kept.
    const auto in = start_.empty() ? piece_ : std::span<const std::uint8_t>(start_);
    const auto [used, filled, is_corrupt] = codec_->decompress(in, content_);
    if (is_corrupt) corrupt_at_ = position_ + used;
    position_ += used;
    if (start_.empty())
      piece_ = piece_.subspan(used);
    else
      start_.erase(start_.begin(), start_.begin() + static_cast<std::ptrdiff_t>(used));
    if (expansion_.of(used, filled) < filled)
      throw UnsupportedFormat(
          "it becomes far larger when it is decompressed than recordings do; decompress it first, "
          "if it is one");
    expansion_.count(filled);
    if (filled > 0) return std::span(content_).first(filled);
    if (used == 0) break;
  }
  if (corrupt_at_) piece_ = {};
  if (is_finished_ && !codec_->may_end() && !corrupt_at_) corrupt_at_ = position_;
  return {};
}

bool DecompressedFile::decompress() {
  while (!is_done_) {
    const auto piece = compressed_.piece(position_);
    if (!piece) return false;
    if (piece->empty()) decompressor_.finish();
    decompressor_.push(*piece);
    position_ += piece->size();
    for (auto part = decompressor_.next(); !part.empty(); part = decompressor_.next())
      content_.append(part);
    is_done_ = piece->empty() || decompressor_.corrupt_at();
  }
  return true;
}

std::optional<std::size_t> DecompressedFile::read(std::uint64_t position,
                                                  std::span<std::uint8_t> out) noexcept {
  const auto from = std::min(position, size());
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(out.size(), size() - from));
  try {
    content_.read(from, out.first(count));
  } catch (const TemporaryFileError&) {
    failed_ = true;
    return std::nullopt;
  }
  return count;
}

std::optional<std::span<const std::uint8_t>> DecompressedFile::piece(std::uint64_t position) {
  piece_.resize(block_size);
  const auto count = read(position, piece_);
  if (!count) return std::nullopt;
  return std::span<const std::uint8_t>(piece_).first(*count);
}

}  // namespace eventcamera
