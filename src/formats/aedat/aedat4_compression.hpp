// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"

struct LZ4F_dctx_s;
struct ZSTD_DCtx_s;
struct ZSTD_CCtx_s;

namespace eventcamera {

/// Frees contexts of lz4 and zstd.
struct Aedat4CompressionDeleter {
  void operator()(LZ4F_dctx_s* context) const;
  void operator()(ZSTD_DCtx_s* context) const;
  void operator()(ZSTD_CCtx_s* context) const;
};

/// Decompresses packets. Memory grows with the actual output, not with sizes stated in the data.
class Aedat4Decompressor {
 public:
  struct Content {
    std::span<const std::uint8_t> bytes;  ///< valid until the next call
    std::size_t used;                     ///< number of bytes of the payload consumed
  };

  /// Returns the content of the compressed frame at the front of `payload`; nothing if it is
  /// corrupt or larger than `limit`. `compression` must not be `none`.
  std::optional<Content> decompress(Aedat4Compression compression,
                                    std::span<const std::uint8_t> payload,
                                    std::size_t limit = aedat4_largest_packet);

 private:
  std::optional<Content> decompress_lz4(std::span<const std::uint8_t> payload, std::size_t limit);
  std::optional<Content> decompress_zstd(std::span<const std::uint8_t> payload, std::size_t limit);
  bool grow(std::size_t limit);

  std::unique_ptr<LZ4F_dctx_s, Aedat4CompressionDeleter> lz4_;
  std::unique_ptr<ZSTD_DCtx_s, Aedat4CompressionDeleter> zstd_;
  std::vector<std::uint8_t> content_;
};

/// Compresses packets.
class Aedat4Compressor {
 public:
  explicit Aedat4Compressor(Aedat4Compression compression);

  /// Appends the compressed `content` to `out`.
  void compress(std::span<const std::uint8_t> content, std::vector<std::uint8_t>& out);

 private:
  Aedat4Compression compression_;
  std::unique_ptr<ZSTD_CCtx_s, Aedat4CompressionDeleter> zstd_;
};

/// True if `bytes` start like a frame of `compression`, which must not be `none`.
bool begins_compressed(Aedat4Compression compression, std::span<const std::uint8_t> bytes);

}  // namespace eventcamera
