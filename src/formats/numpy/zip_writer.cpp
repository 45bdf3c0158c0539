// SPDX-License-Identifier: LGPL-2.1-or-later
// Numbers and names as in PKWARE's APPNOTE.TXT.
#include "src/formats/numpy/zip_writer.hpp"

#include <cstddef>

#include "src/formats/byte_appender.hpp"

namespace eventcamera {

namespace {

constexpr std::uint16_t version = 45;       // ZIP64
constexpr std::uint16_t date = 1 << 5 | 1;  // 1980-01-01, so that equal events are equal bytes
constexpr std::uint16_t zip64_field = 1;

/// Value of 32-bit fields that means: see the ZIP64 field.
constexpr std::uint32_t in_zip64 = 0xffffffff;

bool is_small(std::uint64_t number) {
  return number < in_zip64;
}

std::uint32_t small(std::uint64_t number) {
  return is_small(number) ? static_cast<std::uint32_t>(number) : in_zip64;
}

template <class... Numbers>
void put(std::vector<std::uint8_t>& out, Numbers... numbers) {
  ByteAppender fields(out);
  (fields.put(numbers), ...);
}

void put_text(std::vector<std::uint8_t>& out, std::string_view text) {
  out.insert(out.end(), text.begin(), text.end());
}

/// Appends the fields that begin both descriptions of a file.
void put_file(std::vector<std::uint8_t>& out, std::uint32_t checksum, std::uint32_t size,
              std::string_view name, std::size_t extra) {
  constexpr std::uint16_t none = 0;
  put(out, version, none /* flags */, none /* stored */, none /* time */, date, checksum, size,
      size, static_cast<std::uint16_t>(name.size()), static_cast<std::uint16_t>(extra));
}

}  // namespace

void ZipWriter::begin_file(std::string_view name, std::uint64_t size, std::uint32_t checksum,
                           std::vector<std::uint8_t>& out) {
  const auto begin = out.size();
  files_.push_back({std::string(name), size, checksum, end_});
  constexpr std::uint16_t field = 2 * sizeof size;
  put_text(out, "PK\x03\x04");
  put_file(out, checksum, in_zip64, name, 4 + field);
  put_text(out, name);
  put(out, zip64_field, field, size, size);
  end_ += out.size() - begin + size;
}

void ZipWriter::finish(std::vector<std::uint8_t>& out) const {
  constexpr std::uint16_t none = 0;
  constexpr std::uint32_t first_disk = 0;
  const auto begin = out.size();
  for (const auto& [name, size, checksum, position] : files_) {
    std::vector<std::uint8_t> large;
    if (!is_small(size)) put(large, size, size);
    if (!is_small(position)) put(large, position);
    const auto field = static_cast<std::uint16_t>(large.size());
    put_text(out, "PK\x01\x02");
    put(out, version);
    put_file(out, checksum, small(size), name, large.empty() ? 0 : 4U + field);
    put(out, none /* comment */, none /* disk */, none /* internal attributes */,
        std::uint32_t{0} /* external attributes */, small(position));
    put_text(out, name);
    if (large.empty()) continue;
    put(out, zip64_field, field);
    out.insert(out.end(), large.begin(), large.end());
  }
  const std::uint64_t count = files_.size();
  const std::uint64_t size = out.size() - begin;
  if (!is_small(end_)) {
    put_text(out, "PK\x06\x06");
    put(out, std::uint64_t{44} /* bytes to follow */, version, version, first_disk, first_disk,
        count, count, size, end_);
    put_text(out, "PK\x06\x07");
    put(out, first_disk, end_ + size, std::uint32_t{1} /* disks */);
  }
  const auto few = static_cast<std::uint16_t>(count);
  put_text(out, "PK\x05\x06");
  put(out, none, none, few, few, static_cast<std::uint32_t>(size), small(end_), none);
}

}  // namespace eventcamera
