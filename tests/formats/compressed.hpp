// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <zlib.h>
#include <zstd.h>

#include <cstdint>
#include <span>
#include <vector>

/// Compresses files in memory, as gzip and zstd do.
namespace eventcamera::compressed {

inline std::vector<std::uint8_t> gzip(std::span<const std::uint8_t> bytes) {
  constexpr int as_gzip = 16;
  z_stream stream{};
  deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, MAX_WBITS + as_gzip, 8,
               Z_DEFAULT_STRATEGY);
  std::vector<std::uint8_t> out(deflateBound(&stream, bytes.size()));
  stream.next_in = const_cast<Bytef*>(bytes.data());  // NOLINT: zlib does not change its input
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = out.data();
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

inline std::vector<std::uint8_t> zstd(std::span<const std::uint8_t> bytes) {
  std::vector<std::uint8_t> out(ZSTD_compressBound(bytes.size()));
  out.resize(
      ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), ZSTD_CLEVEL_DEFAULT));
  return out;
}

}  // namespace eventcamera::compressed
