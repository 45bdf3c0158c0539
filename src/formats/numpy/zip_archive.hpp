// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <zip.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/formats/byte_source.hpp"

namespace eventcamera {

/// A file of a ZIP archive, which is read from its beginning on.
class ZipEntry {
 public:
  explicit ZipEntry(zip_file_t* file) : file_(file, zip_fclose) {}

  /// Fills `out`, and returns how many bytes that are: fewer only at the end. Nothing where the
  /// archive is corrupt there.
  std::optional<std::size_t> read(std::span<std::uint8_t> out);

 private:
  std::unique_ptr<zip_file_t, int (*)(zip_file_t*)> file_;
};

/// A ZIP archive in bytes that outlive it.
class ZipArchive {
 public:
  /// Throws UnsupportedFormat where it is none, or lists more files than NumPy would write.
  explicit ZipArchive(ByteSource& source);

  /// The names of its files.
  const std::vector<std::string>& names() const { return names_; }

  /// Opens the file that has this index in names(). Throws UnsupportedFormat where that cannot be
  /// unpacked.
  ZipEntry open(std::size_t index);

 private:
  /// For the library: where it reads.
  struct Input {
    ByteSource* source;
    std::uint64_t position = 0;
    std::uint64_t directory_bytes = 0;  ///< read until the archive was open
    bool is_open = false;
    zip_error_t error = {};
  };

  static zip_int64_t call(void* input, void* data, zip_uint64_t size, zip_source_cmd_t command);

  std::unique_ptr<Input> input_;
  std::unique_ptr<zip_t, void (*)(zip_t*)> archive_;
  std::vector<std::string> names_;
};

}  // namespace eventcamera
