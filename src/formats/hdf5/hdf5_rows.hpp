// SPDX-License-Identifier: LGPL-2.1-or-later
// Rows of datasets that may be corrupt.
#pragma once

#include <algorithm>
#include <cstdint>

#include "src/formats/corruption.hpp"
#include "src/formats/hdf5/hdf5_dataset.hpp"

namespace eventcamera {

/// Returns the end of the block of rows to read at once, from `row` on.
inline std::uint64_t block_end(std::uint64_t row, std::uint64_t rows) {
  constexpr std::uint64_t block_rows = 16384;
  return std::min(rows, (row / block_rows + 1) * block_rows);
}

/// Returns the first row for which `precedes(row)` is false; it must be false for all later rows.
template <class Precedes>
std::uint64_t first_row(std::uint64_t rows, const Precedes& precedes) {
  std::uint64_t first = 0;
  while (rows > 0) {
    const auto half = rows / 2;
    const bool before = precedes(first + half);
    if (before) first += half + 1;
    rows = before ? rows - half - 1 : half;
  }
  return first;
}

/// Finds the position of the first corruption only: the search is slow, and only the first is
/// reported.
inline void note(Corruption& corruption, const Hdf5Dataset& dataset, std::uint64_t row,
                 const char* what) {
  corruption.note(corruption.places == 0 ? dataset.position(row) : 0, what);
}

}  // namespace eventcamera
