// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "src/formats/event_table.hpp"

namespace eventcamera {

constexpr std::string_view npy_magic = "\x93NUMPY";

/// A claimed number of events that means it was unknown: the array goes to the end of the file.
constexpr std::uint64_t npy_unknown_count = std::numeric_limits<std::int64_t>::max();

/// A number in an element of the array.
struct NpyField {
  enum class Kind : std::uint8_t { signed_integer, unsigned_integer, floating, boolean };

  Kind kind = Kind::unsigned_integer;
  bool big_endian = false;
  std::uint32_t bytes = 0;   ///< 1, 2, 4 or 8
  std::uint32_t offset = 0;  ///< in the element
};

/// What a NumPy file's header says of its array of events.
struct NpyHeader {
  std::array<NpyField, 4> fields;  ///< by EventColumn, if there are no `columns`
  std::optional<TimeUnit> unit;    ///< that the name of the time tells
  std::vector<NpyField> columns;   ///< of an array of plain numbers, which have no names
  std::uint32_t element_bytes = 0;
  std::uint64_t count = 0;
};

/// Reads the header's dictionary. Throws UnsupportedFormat where it is neither of a structured
/// array of one dimension that has fields t, x, y and p, nor of an array of numbers: one column, or
/// up to 16 of them in rows.
NpyHeader read_npy_header(std::string_view dictionary);

/// Reads what comes before the array, in pieces of any size.
class NpyPreamble {
 public:
  /// Takes as much from the front of `bytes` as belongs to it; nothing where that is not yet all.
  /// Throws UnsupportedFormat.
  std::optional<NpyHeader> take(std::span<const std::uint8_t>& bytes);

  /// In bytes, as far as it was taken.
  std::size_t size() const { return taken_.size(); }

 private:
  std::vector<std::uint8_t> taken_;
};

}  // namespace eventcamera
