// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/file_formats.hpp"

#include <algorithm>
#include <string_view>

#include "src/core/byte_order.hpp"
#include "src/formats/atis/atis_bin.hpp"
#include "src/formats/corruption.hpp"
#include "src/formats/magic.hpp"
#include "src/formats/prophesee_header.hpp"
#include "src/formats/text/csv_decoder.hpp"

namespace eventcamera {
namespace {

using Bytes = std::span<const std::uint8_t>;

Likelihood certain_if(bool matches) {
  return matches ? Likelihood::certain : Likelihood::none;
}

constexpr std::string_view aedat_magic = "#!AER-DAT";

int aedat_version(Bytes bytes) {
  return bytes[aedat_magic.size()] - '0';
}

Likelihood match_aedat(Bytes bytes) {
  return certain_if(has_at(aedat_magic.size() + 1, ".", bytes) && aedat_version(bytes) >= 1 &&
                    aedat_version(bytes) <= 4);
}

/// Matches a ZIP archive whose first file is a NumPy array.
Likelihood match_npz(Bytes bytes) {
  constexpr std::size_t name_begin = 30;
  constexpr std::string_view ending = ".npy";
  if (bytes.size() < name_begin) return Likelihood::none;
  const std::size_t name_size = little_endian<std::uint16_t>(bytes.data() + 26);
  return certain_if(name_size >= ending.size() &&
                    has_at(name_begin + name_size - ending.size(), ending, bytes));
}

/// Matches an SQLite database whose first page has the tables of a bag.
Likelihood match_rosbag2(Bytes bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return certain_if(text.find("CREATE TABLE topics(") != std::string_view::npos &&
                    text.find("CREATE TABLE messages(") != std::string_view::npos);
}

/// The signature may follow a user block with any content, whose size is a power of two.
Likelihood match_hdf5(Bytes bytes) {
  constexpr std::string_view magic("\x89HDF\r\n\x1a\n", 8);
  if (has_at(0, magic, bytes)) return Likelihood::certain;
  for (const std::size_t block : {512, 1024, 2048, 4096, 8192})
    if (has_at(block, magic, bytes)) return Likelihood::possible;
  return Likelihood::none;
}

bool are_digits(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos;
}

/// True for a number such as 3.0.
bool is_version(std::string_view text) {
  const auto dot = std::min(text.find('.'), text.size());
  return are_digits(text.substr(0, dot)) && dot < text.size() && are_digits(text.substr(dot + 1));
}

/// True for a name of words and their options, such as "EVT3;height=720;width=1280".
bool names_words(std::string_view format) {
  constexpr std::string_view evt = "EVT";
  const auto name = format.substr(0, format.find(';'));
  return name.starts_with(evt) && are_digits(name.substr(evt.size()));
}

/// RAW and DAT start with lines "% key value". RAW names its words there.
constexpr std::string_view prophesee_magic = "% ";

Likelihood match_raw(Bytes bytes) {
  PropheseeHeader header;
  while (const auto line = header.read_line(bytes, false)) {
    bytes = bytes.subspan(line);
    if (is_version(header.value("evt")) || names_words(header.value("format")))
      return Likelihood::certain;
  }
  return Likelihood::none;
}

/// In DAT, the type and size of its events follow the header.
Likelihood match_dat(Bytes bytes) {
  constexpr std::uint8_t types[] = {0x00, 0x0c, 0x0e};
  PropheseeHeader header;
  while (const auto line = header.read_line(bytes, false)) bytes = bytes.subspan(line);
  const bool matches = header.ended() && bytes.size() >= 2 &&
                       std::ranges::count(types, bytes[0]) > 0 && bytes[1] == 8;
  return matches ? Likelihood::high : Likelihood::none;
}

constexpr FileFormat table[] = {
    {.media_type = "application/x-aedat",
     .extensions = "aedat,aedat4",
     .written = "aedat4",
     .magic = aedat_magic,
     .match = match_aedat,
     .version = aedat_version},
    {.media_type = "application/x-es",
     .extensions = "es",
     .written = "es",
     .magic = "Event Stream"},
    {.media_type = "application/x-npy",
     .extensions = "npy",
     .written = "npy",
     .magic = "\x93NUMPY"},
    {.media_type = "application/x-npz",
     .extensions = "npz",
     .written = "npz",
     .magic = {"PK\x03\x04", 4},
     .match = match_npz},
    {.media_type = "application/x-hdf5",
     .extensions = "h5,hdf5",
     .written = "h5 format=dsec; hdf5 format=metavision",
     .match = match_hdf5},
    {.media_type = "application/x-mcap",
     .extensions = "mcap",
     .written = "mcap",
     .magic = mcap_magic},
    {.media_type = "application/x-rosbag", .extensions = "bag", .magic = rosbag_magic},
    {.media_type = "application/x-rosbag2-db3",
     .extensions = "db3",
     .magic = sqlite_magic,
     .match = match_rosbag2},
    {.media_type = "application/x-prophesee-raw",
     .extensions = "raw",
     .written = "raw",
     .magic = prophesee_magic,
     .match = match_raw},
    {.media_type = "application/x-prophesee-dat",
     .extensions = "dat",
     .written = "dat",
     .magic = prophesee_magic,
     .match = match_dat},
    {.media_type = "application/x-event-csv",
     .extensions = "csv,txt",
     .written = "csv; txt format=rpg",
     .match = [](Bytes bytes) { return certain_if(is_csv(bytes)); },
     .has_signature = false},
    {.media_type = "application/x-atis-bin",
     .extensions = "bin",
     .match = [](Bytes bytes) { return is_atis_bin(bytes) ? Likelihood::high : Likelihood::none; },
     .has_signature = false},
};

}  // namespace

std::span<const FileFormat> file_formats() {
  return table;
}

const FileFormat* file_format_of(std::string_view media_type) {
  const auto found = std::ranges::find(table, media_type, &FileFormat::media_type);
  return found == std::end(table) ? nullptr : &*found;
}

Likelihood likelihood(const FileFormat& format, Bytes start) {
  start = start.first(std::min(start.size(), max_recognised_bytes));
  if (!has_at(0, format.magic, start)) return Likelihood::none;
  if (format.match == nullptr) return Likelihood::certain;
  try {
    return format.match(start);
  } catch (const UnsupportedFormat&) {
    return Likelihood::none;
  }
}

}  // namespace eventcamera
