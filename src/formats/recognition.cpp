// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/recognition.hpp"

#include <algorithm>
#include <string_view>

#include "src/core/byte_order.hpp"
#include "src/formats/atis/atis_bin.hpp"
#include "src/formats/magic.hpp"
#include "src/formats/prophesee_header.hpp"
#include "src/formats/ros/bag_magic.hpp"
#include "src/formats/text/csv_decoder.hpp"

namespace eventcamera {
namespace {

using Bytes = std::span<const std::uint8_t>;

/// True for a ZIP archive whose first file is a NumPy array.
bool is_npz(Bytes bytes) {
  constexpr std::size_t name_begin = 30;
  constexpr std::string_view ending = ".npy";
  if (!has_at(0, {"PK\x03\x04", 4}, bytes) || bytes.size() < name_begin) return false;
  const std::size_t name_size = little_endian<std::uint16_t>(bytes.data() + 26);
  return name_size >= ending.size() &&
         has_at(name_begin + name_size - ending.size(), ending, bytes);
}

/// True for an SQLite database whose first page has the tables of a bag.
bool is_rosbag2(Bytes bytes) {
  if (!has_at(0, sqlite_magic, bytes)) return false;
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return text.find("CREATE TABLE topics(") != std::string_view::npos &&
         text.find("CREATE TABLE messages(") != std::string_view::npos;
}

constexpr std::string_view hdf5_magic("\x89HDF\r\n\x1a\n", 8);

/// Recognises formats with a signature.
std::optional<Recognised> by_magic(Bytes bytes) {
  constexpr std::string_view aedat = "#!AER-DAT";
  if (has_at(0, aedat, bytes) && has_at(aedat.size() + 1, ".", bytes)) {
    const int version = bytes[aedat.size()] - '0';
    if (version >= 1 && version <= 4) return Recognised{FileKind::aedat, version};
  }
  if (has_at(0, "Event Stream", bytes)) return Recognised{FileKind::event_stream};
  if (has_at(0, "\x93NUMPY", bytes)) return Recognised{FileKind::npy};
  if (is_npz(bytes)) return Recognised{FileKind::npz};
  if (has_at(0, hdf5_magic, bytes)) return Recognised{FileKind::hdf5};
  if (has_at(0, mcap_magic, bytes)) return Recognised{FileKind::mcap};
  if (has_at(0, rosbag_magic, bytes)) return Recognised{FileKind::rosbag};
  if (is_rosbag2(bytes)) return Recognised{FileKind::rosbag2_db3};
  return std::nullopt;
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

/// Recognises RAW and DAT, which start with lines "% key value". RAW names its words there; in DAT,
/// the type and size of its events follow.
std::optional<Recognised> by_text_header(Bytes bytes) {
  if (!has_at(0, "% ", bytes)) return std::nullopt;
  PropheseeHeader header;
  while (const auto line = header.take(bytes, false)) {
    bytes = bytes.subspan(line);
    if (is_version(header.value("evt")) || names_words(header.value("format")))
      return Recognised{FileKind::prophesee_raw};
  }
  constexpr std::uint8_t types[] = {0x00, 0x0c, 0x0e};
  if (header.ended() && bytes.size() >= 2 && std::ranges::count(types, bytes[0]) > 0 &&
      bytes[1] == 8)
    return Recognised{FileKind::prophesee_dat, 0, false};
  return std::nullopt;
}

/// True if CsvDecoder decodes every line as an event, and the columns have names or there are some
/// events. An ambiguous time unit does not matter here, nor do events outside a sensor; they are
/// reported when the file is read.
bool is_csv(Bytes bytes) {
  constexpr std::size_t max_bytes = 4096;
  constexpr std::size_t min_events = 3;
  bytes = bytes.first(std::min(bytes.size(), max_bytes));
  const auto is_text = [](std::uint8_t byte) {
    return byte >= ' ' || (byte >= '\t' && byte <= '\r');
  };
  if (!std::ranges::all_of(bytes, is_text)) return false;
  while (!bytes.empty() && bytes.back() != '\n') bytes = bytes.first(bytes.size() - 1);
  CsvDecoder decoder({.unit = TimeUnit::microseconds});
  Decoded decoded;
  decoder.decode(bytes, decoded);
  decoder.finish(decoded);
  const auto events = decoded.events.size() + decoder.corruption().outside;
  return (decoder.has_names() || events >= min_events) && decoder.corruption().places == 0;
}

/// Recognises HDF5 after a user block with any content, whose size is a power of two.
std::optional<Recognised> by_user_block(Bytes bytes) {
  for (const std::size_t block : {512, 1024, 2048, 4096, 8192})
    if (has_at(block, hdf5_magic, bytes)) return Recognised{FileKind::hdf5, 0, false};
  return std::nullopt;
}

}  // namespace

std::optional<Recognised> recognise(Bytes start, std::optional<FileKind> wanted) {
  start = start.first(std::min(start.size(), max_recognised_bytes));
  if (const auto found = by_magic(start)) return found;
  const auto after_block = by_user_block(start);
  try {
    if (const auto found = by_text_header(start)) return found;
    const bool may_be_csv = !wanted || *wanted == FileKind::csv || after_block;
    if (may_be_csv && is_csv(start)) return Recognised{FileKind::csv};
  } catch (const UnsupportedFormat&) {
    // Not a text of events, but possibly a user block.
  }
  if (!after_block && is_atis_bin(start)) return Recognised{FileKind::atis_bin, 0, false};
  return after_block;
}

}  // namespace eventcamera
