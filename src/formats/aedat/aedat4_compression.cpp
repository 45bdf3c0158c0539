// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/aedat/aedat4_compression.hpp"

namespace eventcamera {

Aedat4Compressor::Aedat4Compressor(Aedat4Compression compression) {
  if (compression == Aedat4Compression::none) return;
  const bool is_high =
      compression == Aedat4Compression::lz4_high || compression == Aedat4Compression::zstd_high;
  compressor_.emplace(codec_of(compression),
                      is_high ? FrameCompressor::Level::high : FrameCompressor::Level::standard);
}

void Aedat4Compressor::compress(std::span<const std::uint8_t> content,
                                std::vector<std::uint8_t>& out) {
  if (compressor_)
    compressor_->compress(content, out);
  else
    out.insert(out.end(), content.begin(), content.end());
}

}  // namespace eventcamera
