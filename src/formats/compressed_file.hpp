// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "src/formats/byte_source.hpp"
#include "src/formats/compression/compressed_frames.hpp"
#include "src/formats/temporary_file.hpp"

namespace eventcamera {

/// Decompresses a file compressed with gzip or zstd, such as events.csv.gz, recognised by its first
/// bytes; returns other files unchanged.
///
///     decompressor.push(piece);
///     while (!decompressor.next().empty()) ...
class FileDecompressor {
 public:
  FileDecompressor();
  ~FileDecompressor();
  FileDecompressor(const FileDecompressor&) = delete;
  FileDecompressor& operator=(const FileDecompressor&) = delete;

  /// Adds bytes, which must stay valid until next() returns nothing.
  void push(std::span<const std::uint8_t> piece) { piece_ = piece; }

  /// Declares the end of the file: next() returns the rest.
  void finish() { is_finished_ = true; }

  /// Returns the next bytes, valid until the next call; none if more are needed. Throws
  /// UnsupportedFormat if the file becomes too large for its size.
  std::span<const std::uint8_t> next();

  bool is_compressed() const { return codec_ != nullptr; }

  /// Position in the compressed file where it is corrupt or cut short; nothing can be read from
  /// there on.
  std::optional<std::uint64_t> corrupt_at() const { return corrupt_at_; }

  static bool is_compressed(std::span<const std::uint8_t> start);

  static constexpr std::size_t magic_size = 4;

 private:
  class Codec;
  class Gzip;
  class Zstd;

  static std::unique_ptr<Codec> codec_of(std::span<const std::uint8_t> start);

  std::unique_ptr<Codec> codec_;  ///< null: not compressed, or not known yet
  bool is_known_ = false;         ///< whether the file is compressed
  bool is_finished_ = false;
  std::vector<std::uint8_t> start_;  ///< the first bytes, until it is known
  std::span<const std::uint8_t> piece_;
  std::uint64_t position_ = 0;  ///< of the next byte to decompress
  std::optional<std::uint64_t> corrupt_at_;
  std::vector<std::uint8_t> content_;
  ExpansionLimit expansion_{256};
};

/// Random access to the content of a compressed file, decompressed to a temporary file.
class DecompressedFile final : public ByteSource {
 public:
  /// `compressed` must outlive this object.
  explicit DecompressedFile(ByteSource& compressed) : compressed_(compressed) {}

  /// Decompresses the file, once, before anything is read; continues if reading failed before.
  /// False if reading fails. Throws UnsupportedFormat and TemporaryFileError.
  bool decompress();

  /// As FileDecompressor::corrupt_at().
  std::optional<std::uint64_t> corrupt_at() const { return decompressor_.corrupt_at(); }

  std::uint64_t size() const override { return content_.size(); }
  std::optional<std::size_t> read(std::uint64_t position,
                                  std::span<std::uint8_t> out) noexcept override;
  std::optional<std::span<const std::uint8_t>> piece(std::uint64_t position) override;
  bool failed() const noexcept override { return failed_; }

 private:
  ByteSource& compressed_;
  FileDecompressor decompressor_;
  std::uint64_t position_ = 0;  ///< in the compressed file
  bool is_done_ = false;
  bool failed_ = false;
  TemporaryFile content_;
  std::vector<std::uint8_t> piece_;
};

}  // namespace eventcamera
