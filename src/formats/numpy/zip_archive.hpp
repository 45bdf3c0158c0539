// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <zip.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "src/formats/byte_source.hpp"

namespace eventcamera {

/// File in a ZIP archive, read sequentially.
class ZipEntry {
 public:
  explicit ZipEntry(zip_file_t* file) : file_(file, zip_fclose) {}

  /// Reads into `out` and returns the number of bytes, which is smaller only at the end. Nothing if
  /// the archive is corrupt there.
  std::optional<std::size_t> read(std::span<std::uint8_t> out);

 private:
  std::unique_ptr<zip_file_t, int (*)(zip_file_t*)> file_;
};

/// ZIP archive in a ByteSource.
class ZipArchive {
 public:
  /// `source` must outlive the archive. Throws UnsupportedFormat if it is not a ZIP archive, or has
  /// more files than NumPy would write.
  explicit ZipArchive(ByteSource& source);

  /// Names of the files.
  const std::vector<std::string>& names() const { return names_; }

  /// Opens the file with this index in names(). Throws UnsupportedFormat if it cannot be
  /// decompressed.
  ZipEntry open(std::size_t index);

 private:
  /// Read state for the library.
  struct Input {
    ByteSource* source;
    std::uint64_t position = 0;
    std::uint64_t directory_bytes = 0;  ///< bytes read while opening the archive
    bool is_open = false;
    zip_error_t error = {};
  };

  static zip_int64_t call(void* input, void* data, zip_uint64_t size, zip_source_cmd_t command);

  std::unique_ptr<Input> input_;
  std::unique_ptr<zip_t, void (*)(zip_t*)> archive_;
  std::vector<std::string> names_;
};

/// Writes a ZIP archive from start to end, without seeking back: the size and the checksum of a
/// file must be known before its content. Files are not compressed; they may exceed 4 GiB (ZIP64).
///
///     archive.begin_file(name, content.size(), crc32(...), out);
///     out.insert(out.end(), content.begin(), content.end());
///     archive.finish(out);
class ZipWriter {
 public:
  /// Appends the header of a file, whose content must follow.
  void begin_file(std::string_view name, std::uint64_t size, std::uint32_t checksum,
                  std::vector<std::uint8_t>& out);

  /// Appends the directory after the content of the last file.
  void finish(std::vector<std::uint8_t>& out) const;

 private:
  struct File {
    std::string name;
    std::uint64_t size;
    std::uint32_t checksum;
    std::uint64_t position;  ///< of its header
  };

  std::vector<File> files_;
  std::uint64_t end_ = 0;  ///< end of the last file
};

}  // namespace eventcamera
