// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "src/formats/event_table.hpp"

namespace eventcamera {

constexpr std::string_view npy_magic = "\x93NUMPY";

/// Count in the header that means unknown: the array extends to the end of the file.
constexpr std::uint64_t npy_unknown_count = std::numeric_limits<std::int64_t>::max();

/// Number within an element of the array.
struct NpyField {
  enum class Kind : std::uint8_t { signed_integer, unsigned_integer, floating, boolean };

  Kind kind = Kind::unsigned_integer;
  bool big_endian = false;
  std::uint32_t bytes = 0;   ///< 1, 2, 4 or 8
  std::uint32_t offset = 0;  ///< offset in the element
};

/// Description of the array of events in the header of a NumPy file.
struct NpyHeader {
  /// By EventColumn, if there are no `columns`. Labels have 0 bytes if there are none.
  std::array<NpyField, all_columns> fields;
  std::optional<TimeUnit> unit;   ///< time unit, if the name of the field states it
  std::vector<NpyField> columns;  ///< columns of an array of plain numbers, without names
  std::uint32_t element_bytes = 0;
  std::uint64_t count = 0;
  bool by_columns = false;  ///< the numbers of a column follow each other: Fortran order, or (4, N)
};

/// Parses the dictionary of the header. Throws UnsupportedFormat unless it describes a
/// one-dimensional structured array with fields t, x, y and p, or an array of numbers with up to 16
/// columns, in any order. A number without dimensions is an array of one.
NpyHeader read_npy_header(std::string_view dictionary);

/// Returns the preamble of a file with this dictionary.
std::string npy_preamble(std::string_view dictionary);

/// Reads the preamble before the array, in pieces of any size.
class NpyPreamble {
 public:
  /// Consumes the preamble from the front of `bytes`. Returns nothing until it is complete. Throws
  /// UnsupportedFormat.
  std::optional<NpyHeader> read(std::span<const std::uint8_t>& bytes);

  /// Bytes consumed so far.
  std::size_t size() const { return read_.size(); }

 private:
  std::vector<std::uint8_t> read_;
};

}  // namespace eventcamera
