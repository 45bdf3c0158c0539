// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace eventcamera {

/// Limits the decompressed size of a file, because a few kilobytes of zeros would take minutes: to
/// 256 MiB plus `max_ratio` times the compressed size.
class ExpansionLimit {
 public:
  explicit ExpansionLimit(std::uint64_t max_ratio = of_pictures) : max_ratio_(max_ratio) {}

  /// Maximum size of the content of the next `compressed` bytes, at most `limit`.
  std::size_t of(std::size_t compressed, std::size_t limit) {
    allowed_ += max_ratio_ * compressed;
    return static_cast<std::size_t>(std::min<std::uint64_t>(limit, allowed_));
  }

  void count(std::size_t bytes) { allowed_ -= std::min<std::uint64_t>(bytes, allowed_); }

 private:
  /// Camera frames reach a ratio of 100. Black ones reach 13,000, and use up the 256 MiB in a few
  /// hundred frames.
  static constexpr std::uint64_t of_pictures = 2048;

  std::uint64_t max_ratio_;
  std::uint64_t allowed_ = std::uint64_t{1} << 28;
};

}  // namespace eventcamera

struct LZ4F_dctx_s;
struct ZSTD_DCtx_s;
struct ZSTD_CCtx_s;

namespace eventcamera {

/// Compressed formats that state where they end: LZ4 frames and Zstandard frames.
enum class FrameCodec : std::uint8_t { lz4, zstd };

struct CompressionDeleter {
  void operator()(LZ4F_dctx_s* context) const;
  void operator()(ZSTD_DCtx_s* context) const;
  void operator()(ZSTD_CCtx_s* context) const;
};

/// Decompresses frames. Memory grows with the actual output, not with sizes stated in the data.
class FrameDecompressor {
 public:
  struct Content {
    std::span<const std::uint8_t> bytes;  ///< valid until the next call
    std::size_t used;                     ///< number of bytes of the payload consumed
  };

  /// Returns the content of the compressed frame at the front of `payload`; nothing if it is
  /// corrupt, larger than `limit`, or beyond the ExpansionLimit.
  std::optional<Content> decompress(FrameCodec codec, std::span<const std::uint8_t> payload,
                                    std::size_t limit);

 private:
  std::optional<Content> decompress_lz4(std::span<const std::uint8_t> payload, std::size_t limit);
  std::optional<Content> decompress_zstd(std::span<const std::uint8_t> payload, std::size_t limit);
  bool grow(std::size_t payload, std::size_t limit);

  std::unique_ptr<LZ4F_dctx_s, CompressionDeleter> lz4_;
  std::unique_ptr<ZSTD_DCtx_s, CompressionDeleter> zstd_;
  std::vector<std::uint8_t> content_;
  ExpansionLimit expansion_;
};

/// Compresses frames; without a codec, leaves them as they are.
class FrameCompressor {
 public:
  enum class Level : std::uint8_t { standard, high };

  explicit FrameCompressor(std::optional<FrameCodec> codec, Level level = Level::standard);

  /// Appends the compressed `content` to `out`.
  void compress(std::span<const std::uint8_t> content, std::vector<std::uint8_t>& out);

 private:
  std::optional<FrameCodec> codec_;
  Level level_;
  std::unique_ptr<ZSTD_CCtx_s, CompressionDeleter> zstd_;
};

/// True if `bytes` start like a frame of `codec`.
bool begins_frame(FrameCodec codec, std::span<const std::uint8_t> bytes);

}  // namespace eventcamera
