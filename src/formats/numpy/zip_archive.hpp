// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <zip.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "src/formats/byte_cursor.hpp"
#include "src/formats/byte_source.hpp"
#include "src/formats/corruption.hpp"

namespace eventcamera {

/// File in a ZIP archive, read sequentially.
class ZipEntry {
 public:
  explicit ZipEntry(zip_file_t* file) : file_(file, zip_fclose) {}

  /// Reads into `out` and returns the number of bytes, which is smaller only at the end. Nothing if
  /// the archive is corrupt there.
  std::optional<std::size_t> read(std::span<std::uint8_t> out) {
    std::size_t filled = 0;
    while (filled < out.size()) {
      const auto count = zip_fread(file_.get(), out.data() + filled, out.size() - filled);
      if (count < 0) return std::nullopt;
      if (count == 0) break;
      filled += static_cast<std::size_t>(count);
    }
    return filled;
  }

 private:
  std::unique_ptr<zip_file_t, int (*)(zip_file_t*)> file_;
};

/// ZIP archive in a ByteSource.
class ZipArchive {
 public:
  /// `source` must outlive the archive. Throws UnsupportedFormat if it is not a ZIP archive, or has
  /// more files than NumPy would write.
  explicit ZipArchive(ByteSource& source)
      : input_(std::make_unique<Input>(Input{.source = &source})), archive_(nullptr, zip_discard) {
    zip_error_t error;
    zip_error_init(&error);
    zip_source_t* const bytes = zip_source_function_create(call, input_.get(), &error);
    archive_.reset(bytes != nullptr ? zip_open_from_source(bytes, ZIP_RDONLY, &error) : nullptr);
    const std::string cause = zip_error_strerror(&error);
    zip_error_fini(&error);
    if (!archive_) {
      zip_source_free(bytes);
      throw UnsupportedFormat("the ZIP archive cannot be opened: " + cause);
    }
    input_->is_open = true;
    const auto count = zip_get_num_entries(archive_.get(), 0);
    for (zip_int64_t i = 0; i < count; ++i) {
      const char* const name =
          zip_get_name(archive_.get(), static_cast<zip_uint64_t>(i), ZIP_FL_ENC_RAW);
      names_.emplace_back(name != nullptr ? name : "");
    }
  }

  const std::vector<std::string>& names() const { return names_; }

  /// Opens the file with this index in names(). Throws UnsupportedFormat if it cannot be
  /// decompressed.
  ZipEntry open(std::size_t index) {
    zip_file_t* const file = zip_fopen_index(archive_.get(), index, 0);
    if (file == nullptr)
      throw UnsupportedFormat(names_[index] + " in the ZIP archive cannot be unpacked: " +
                              zip_strerror(archive_.get()));
    return ZipEntry(file);
  }

 private:
  /// Limit of the directory, which the library keeps in memory. It has about 100 bytes per array.
  static constexpr std::uint64_t max_directory_bytes = std::uint64_t{1} << 22;

  /// Read state for the library.
  struct Input {
    ByteSource* source;
    std::uint64_t position = 0;
    std::uint64_t directory_bytes = 0;  ///< bytes read while opening the archive
    bool is_open = false;
    zip_error_t error = {};
  };

  static zip_int64_t call(void* data, void* to, zip_uint64_t size, zip_source_cmd_t command) {
    auto& input = *static_cast<Input*>(data);
    switch (command) {
      case ZIP_SOURCE_SUPPORTS:
        return zip_source_make_command_bitmap(ZIP_SOURCE_SUPPORTS, ZIP_SOURCE_OPEN, ZIP_SOURCE_READ,
                                              ZIP_SOURCE_CLOSE, ZIP_SOURCE_STAT, ZIP_SOURCE_ERROR,
                                              ZIP_SOURCE_FREE, ZIP_SOURCE_SEEK, ZIP_SOURCE_TELL,
                                              -1);
      case ZIP_SOURCE_OPEN:
        input.position = 0;
        return 0;
      case ZIP_SOURCE_READ: {
        const bool is_too_much =
            !input.is_open && size > max_directory_bytes - input.directory_bytes;
        const auto count = is_too_much ? std::nullopt
                                       : input.source->read(input.position,
                                                            {static_cast<std::uint8_t*>(to), size});
        if (!count) {
          zip_error_set(&input.error, ZIP_ER_READ, 0);
          return -1;
        }
        if (!input.is_open) input.directory_bytes += *count;
        input.position += *count;
        return static_cast<zip_int64_t>(*count);
      }
      case ZIP_SOURCE_SEEK: {
        const auto position = zip_source_seek_compute_offset(input.position, input.source->size(),
                                                             to, size, &input.error);
        if (position < 0) return -1;
        input.position = static_cast<std::uint64_t>(position);
        return 0;
      }
      case ZIP_SOURCE_TELL:
        return static_cast<zip_int64_t>(input.position);
      case ZIP_SOURCE_STAT: {
        auto& stat = *static_cast<zip_stat_t*>(to);
        zip_stat_init(&stat);
        stat.size = input.source->size();
        stat.valid = ZIP_STAT_SIZE;
        return sizeof stat;
      }
      case ZIP_SOURCE_ERROR:
        return zip_error_to_data(&input.error, to, size);
      case ZIP_SOURCE_CLOSE:
      case ZIP_SOURCE_FREE:
        return 0;
      default:
        zip_error_set(&input.error, ZIP_ER_OPNOTSUPP, 0);
        return -1;
    }
  }

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
                  std::vector<std::uint8_t>& out) {
    const auto begin = out.size();
    files_.push_back({std::string(name), size, checksum, end_});
    constexpr std::uint16_t field = 2 * sizeof size;
    put_text(out, "PK\x03\x04");
    put_file(out, checksum, in_zip64, name, 4 + field);
    put_text(out, name);
    ByteAppender(out).put(zip64_field, field, size, size);
    end_ += out.size() - begin + size;
  }

  /// Appends the directory after the content of the last file.
  void finish(std::vector<std::uint8_t>& out) const {
    constexpr std::uint16_t none = 0;
    constexpr std::uint32_t first_disk = 0;
    const auto begin = out.size();
    for (const auto& [name, size, checksum, position] : files_) {
      std::vector<std::uint8_t> large;
      if (!is_small(size)) ByteAppender(large).put(size, size);
      if (!is_small(position)) ByteAppender(large).put(position);
      const auto field = static_cast<std::uint16_t>(large.size());
      put_text(out, "PK\x01\x02");
      ByteAppender(out).put(version);
      put_file(out, checksum, small(size), name, large.empty() ? 0 : 4U + field);
      ByteAppender(out).put(none /* comment */, none /* disk */, none /* internal attributes */,
                            std::uint32_t{0} /* external attributes */, small(position));
      put_text(out, name);
      if (large.empty()) continue;
      ByteAppender(out).put(zip64_field, field);
      out.insert(out.end(), large.begin(), large.end());
    }
    const std::uint64_t count = files_.size();
    const std::uint64_t size = out.size() - begin;
    if (!is_small(end_)) {
      put_text(out, "PK\x06\x06");
      ByteAppender(out).put(std::uint64_t{44} /* bytes to follow */, version, version, first_disk,
                            first_disk, count, count, size, end_);
      put_text(out, "PK\x06\x07");
      ByteAppender(out).put(first_disk, end_ + size, std::uint32_t{1} /* disks */);
    }
    const auto few = static_cast<std::uint16_t>(count);
    put_text(out, "PK\x05\x06");
    ByteAppender(out).put(none, none, few, few, static_cast<std::uint32_t>(size), small(end_),
                          none);
  }

 private:
  // Numbers and names as in PKWARE's APPNOTE.TXT.
  static constexpr std::uint16_t version = 45;  ///< ZIP64
  /// 1980-01-01, so that equal events are equal bytes.
  static constexpr std::uint16_t date = 1 << 5 | 1;
  static constexpr std::uint16_t zip64_field = 1;

  /// Value of 32-bit fields that means: see the ZIP64 field.
  static constexpr std::uint32_t in_zip64 = 0xffffffff;

  static bool is_small(std::uint64_t number) { return number < in_zip64; }

  static std::uint32_t small(std::uint64_t number) {
    return is_small(number) ? static_cast<std::uint32_t>(number) : in_zip64;
  }

  static void put_text(std::vector<std::uint8_t>& out, std::string_view text) {
    out.insert(out.end(), text.begin(), text.end());
  }

  /// Appends the fields that begin both descriptions of a file.
  static void put_file(std::vector<std::uint8_t>& out, std::uint32_t checksum, std::uint32_t size,
                       std::string_view name, std::size_t extra) {
    constexpr std::uint16_t none = 0;
    ByteAppender(out).put(version, none /* flags */, none /* stored */, none /* time */, date,
                          checksum, size, size, static_cast<std::uint16_t>(name.size()),
                          static_cast<std::uint16_t>(extra));
  }

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
