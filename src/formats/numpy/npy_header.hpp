// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string_view>

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
  std::array<NpyField, 4> fields;  ///< by EventColumn
  std::uint32_t element_bytes = 0;
  std::uint64_t count = 0;
};

/// Reads the header's dictionary. Throws UnsupportedFormat where it is not of a structured array of
/// one dimension that has fields t, x, y and p.
NpyHeader read_npy_header(std::string_view dictionary);

}  // namespace eventcamera
