// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/compression/compressed_frames.hpp"

#include <lz4frame.h>
#include <lz4hc.h>
#include <zstd.h>
#include <zstd_errors.h>

#include <algorithm>
#include <new>
#include <stdexcept>

#include "src/core/byte_order.hpp"

namespace eventcamera {

namespace {

/// Limits of the first buffer for the content of a frame, and its size relative to the frame
/// between these.
constexpr std::size_t min_content = std::size_t{4} << 10;
constexpr std::size_t max_first_content = std::size_t{256} << 10;
constexpr std::size_t expected_ratio = 4;
constexpr std::uint32_t lz4_magic = 0x184D2204;
constexpr std::uint32_t zstd_magic = 0xFD2FB528;
constexpr int zstd_high_level = 9;

}  // namespace

bool begins_frame(FrameCodec codec, std::span<const std::uint8_t> bytes) {
  return bytes.size() >= 4 && little_endian<std::uint32_t>(bytes.data()) ==
                                  (codec == FrameCodec::lz4 ? lz4_magic : zstd_magic);
}

void CompressionDeleter::operator()(LZ4F_dctx_s* context) const {
  LZ4F_freeDecompressionContext(context);
}

void CompressionDeleter::operator()(ZSTD_DCtx_s* context) const {
  ZSTD_freeDCtx(context);
}

void CompressionDeleter::operator()(ZSTD_CCtx_s* context) const {
  ZSTD_freeCCtx(context);
}

std::optional<FrameDecompressor::Content> FrameDecompressor::decompress(
    FrameCodec codec, std::span<const std::uint8_t> payload, std::size_t limit) {
  limit = expansion_.of(payload.size(), limit);
  const auto content =
      codec == FrameCodec::lz4 ? decompress_lz4(payload, limit) : decompress_zstd(payload, limit);
  expansion_.count(content ? content->bytes.size() : std::min(limit, content_.size()));
  return content;
}

std::optional<FrameDecompressor::Content> FrameDecompressor::decompress_lz4(
    std::span<const std::uint8_t> payload, std::size_t limit) {
  if (!lz4_) {
    LZ4F_dctx* context = nullptr;
    if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0)
      throw std::bad_alloc();
    lz4_.reset(context);
  }
  LZ4F_resetDecompressionContext(lz4_.get());
  std::size_t used = 0;
  std::size_t filled = 0;
  while (true) {
    if (filled == std::min(content_.size(), limit) && !grow(payload.size(), limit))
      return std::nullopt;
    auto to = std::min(content_.size(), limit) - filled;
    auto from = payload.size() - used;
    const auto result = LZ4F_decompress(lz4_.get(), content_.data() + filled, &to,
                                        payload.data() + used, &from, nullptr);
    if (LZ4F_isError(result) != 0) return std::nullopt;
    used += from;
    filled += to;
    if (filled > limit) return std::nullopt;
    if (result == 0) return Content{{content_.data(), filled}, used};
    if (from == 0 && to == 0) return std::nullopt;  // the payload is truncated
  }
}

std::optional<FrameDecompressor::Content> FrameDecompressor::decompress_zstd(
    std::span<const std::uint8_t> payload, std::size_t limit) {
  const auto used = ZSTD_findFrameCompressedSize(payload.data(), payload.size());
  if (ZSTD_isError(used) != 0) return std::nullopt;
  if (!zstd_) zstd_.reset(ZSTD_createDCtx());
  if (!zstd_) throw std::bad_alloc();
  if (content_.empty()) grow(payload.size(), limit);
  // Decompresses in one call, so that the output serves as window: the streaming decoder would
  // allocate a window of the size stated in the frame. Starts over if the output is too small.
  while (true) {
    const auto size = ZSTD_decompressDCtx(zstd_.get(), content_.data(),
                                          std::min(content_.size(), limit), payload.data(), used);
    if (ZSTD_isError(size) == 0) {
      if (size > limit) return std::nullopt;
      return Content{{content_.data(), size}, used};
    }
    if (ZSTD_getErrorCode(size) != ZSTD_error_dstSize_tooSmall || !grow(payload.size(), limit))
      return std::nullopt;
  }
}

bool FrameDecompressor::grow(std::size_t payload, std::size_t limit) {
  if (content_.size() >= limit) return false;
  const auto expected = std::clamp(std::min(payload, max_first_content) * expected_ratio,
                                   min_content, max_first_content);
  content_.resize(std::min(limit, std::max(expected, 2 * content_.size())));
  return true;
}

FrameCompressor::FrameCompressor(std::optional<FrameCodec> codec, Level level)
    : codec_(codec), level_(level) {
  if (codec != FrameCodec::zstd) return;
  zstd_.reset(ZSTD_createCCtx());
  if (!zstd_) throw std::bad_alloc();
  ZSTD_CCtx_setParameter(zstd_.get(), ZSTD_c_compressionLevel,
                         level == Level::standard ? ZSTD_CLEVEL_DEFAULT : zstd_high_level);
}

void FrameCompressor::compress(std::span<const std::uint8_t> content,
                               std::vector<std::uint8_t>& out) {
  if (!codec_) {
    out.insert(out.end(), content.begin(), content.end());
    return;
  }
  const auto at = out.size();
  std::size_t size = 0;
  if (codec_ == FrameCodec::lz4) {
    LZ4F_preferences_t preferences{};
    preferences.compressionLevel = level_ == Level::high ? LZ4HC_CLEVEL_DEFAULT : 0;
    out.resize(at + LZ4F_compressFrameBound(content.size(), &preferences));
    size = LZ4F_compressFrame(out.data() + at, out.size() - at, content.data(), content.size(),
                              &preferences);
    if (LZ4F_isError(size) != 0) throw std::runtime_error(LZ4F_getErrorName(size));
  } else {
    out.resize(at + ZSTD_compressBound(content.size()));
    size = ZSTD_compress2(zstd_.get(), out.data() + at, out.size() - at, content.data(),
                          content.size());
    if (ZSTD_isError(size) != 0) throw std::runtime_error(ZSTD_getErrorName(size));
  }
  out.resize(at + size);
}

}  // namespace eventcamera
