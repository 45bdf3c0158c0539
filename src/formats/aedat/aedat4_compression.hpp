// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"
#include "src/formats/compression/compressed_frames.hpp"

namespace eventcamera {

/// Codec of compressed packets; `compression` must not be `none`.
constexpr FrameCodec codec_of(Aedat4Compression compression) {
  const bool is_lz4 =
      compression == Aedat4Compression::lz4 || compression == Aedat4Compression::lz4_high;
  return is_lz4 ? FrameCodec::lz4 : FrameCodec::zstd;
}

/// Compresses packets.
class Aedat4Compressor {
 public:
  explicit Aedat4Compressor(Aedat4Compression compression);

  /// Appends the compressed `content` to `out`.
  void compress(std::span<const std::uint8_t> content, std::vector<std::uint8_t>& out);

 private:
  std::optional<FrameCompressor> compressor_;  ///< none: packets are stored as they are
};

}  // namespace eventcamera
