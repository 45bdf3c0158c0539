// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/formats/corruption.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/hdf5/hdf5_handle.hpp"

namespace eventcamera {

/// Dataset with rows of numbers in an untrusted file. Checks that it is stored in the file itself,
/// that chunk sizes are bounded, and that the file has as many rows as it claims.
class Hdf5Dataset {
 public:
  /// True if there is an object of this type at `path`; links to other files do not count.
  static bool exists(hid_t parent, const std::string& path, H5O_type_t type);

  /// Throws UnsupportedFormat if the dataset is missing or invalid.
  Hdf5Dataset(hid_t parent, const std::string& path);

  int rank() const { return static_cast<int>(extent_.size()); }
  std::uint64_t rows() const { return rows_; }
  std::uint64_t claimed_rows() const { return extent_.empty() ? 1 : extent_[0]; }
  std::uint64_t columns() const { return extent_.size() < 2 ? 1 : extent_[1]; }
  bool is_numbers() const { return !numbers_.empty(); }
  bool is_integers() const { return is_numbers() && !numbers_[0].is_floating; }
  bool is_unsigned_32() const {
    return is_integers() && numbers_[0].bytes == 4 && !numbers_[0].is_signed;
  }

  bool is_doubles() const {
    return is_numbers() && numbers_[0].is_floating && numbers_[0].bytes == sizeof(double);
  }

  /// Names of the members of a compound type; none for another type.
  std::vector<std::string> members() const;

  /// Selects the members of a compound type to read. Throws UnsupportedFormat if one is missing or
  /// not a number.
  void choose(std::span<const std::string> members);

  /// Converts a column, or chosen member, from this time unit to microseconds.
  void set_unit(std::size_t column, TimeUnit unit) {
    time_column_ = column;
    power_ = power_of(unit);
  }

  /// Reads the first rows without converting times. False if the file is corrupt there.
  bool sample(std::uint64_t count, std::vector<TableSample::Row>& out);

  /// Reads all columns or chosen members of rows. Rounds fractions down, except for times within
  /// max_rounding_up of the next integer. False if the file is corrupt there.
  bool read(std::uint64_t first, std::uint64_t count, std::vector<std::int64_t>& out);

  /// Rows per chunk; 0 if the dataset is not chunked.
  std::uint64_t chunk_rows() const { return chunk_.empty() ? 0 : chunk_[0]; }
  /// First row after the chunk of a row.
  std::uint64_t chunk_end(std::uint64_t row) const {
    return chunk_.empty() ? rows_
                          : std::min<std::uint64_t>(rows_, (row / chunk_[0] + 1) * chunk_[0]);
  }
  /// True if this is the only filter of the chunks.
  bool has_only_filter(int filter) const { return filters_.size() == 1 && filters_[0] == filter; }
  /// Reads the stored bytes of the chunk that starts at a row. False if it is missing or larger
  /// than `max_stored` bytes.
  bool read_chunk(std::uint64_t row, std::size_t max_stored, std::vector<std::uint8_t>& out);

  /// Position of a row, or its chunk, in the file; 0 if unknown. Slow: the library searches all
  /// chunks.
  std::uint64_t position(std::uint64_t row) const;

  /// Throws UnsupportedFormat if a filter that the dataset needs is not available.
  void require_filters();

 private:
  /// Number within an element.
  struct Number {
    std::size_t offset = 0;
    std::size_t bytes = 0;
    bool is_signed = false;
    bool big_endian = false;
    bool is_floating = false;
  };

  static std::optional<Number> number_of(hid_t type);
  template <class Unsigned>
  void widen(const std::uint8_t* element, const Number& number, std::span<std::int64_t> out) const;
  void read_bits(std::span<const std::uint8_t> bytes, std::vector<std::int64_t>& out) const;
  std::int64_t number_from(std::int64_t bits, std::size_t column) const;
  void check_chunks();
  void check_storage(hid_t file);

  bool read_stored(const hsize_t* offset, std::size_t max_stored, std::vector<std::uint8_t>& out,
                   std::uint32_t& filter_mask);
  bool load(std::uint64_t block);
  bool read_elements(std::uint64_t first, std::uint64_t count, std::vector<std::uint8_t>& out);

  std::string path_;
  Hdf5Handle dataset_, type_, creation_;
  std::size_t type_bytes_ = 0;  ///< size of an element
  std::size_t time_column_ = 0;
  int power_ = 0;                ///< power of ten from the unit of times to microseconds
  std::vector<Number> numbers_;  ///< numbers to read of each element
  std::vector<hsize_t> extent_;
  std::uint64_t rows_ = 0;
  std::uint64_t file_bytes_ = 0;
  std::vector<hsize_t> chunk_;  ///< extent of a chunk; empty if not chunked
  std::size_t chunk_bytes_ = 0;

  std::vector<int> filters_;
  bool own_filters_ = false;  ///< applied by hdf5_filters.hpp, with bounds that the library lacks
  struct Free {
    void operator()(std::uint8_t* bytes) const { std::free(bytes); }
  };
  std::unique_ptr<std::uint8_t, Free> scratch_;  ///< for chunks of unknown size
  std::vector<std::uint8_t> loaded_;             ///< rows of one row of chunks
  std::optional<std::uint64_t> loaded_block_;
};

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

/// Records corruption; looks up the position of the first only, because the search is slow and no
/// other is reported.
inline void note(Corruption& corruption, const Hdf5Dataset& dataset, std::uint64_t row,
                 const char* what) {
  corruption.note(corruption.places == 0 ? dataset.position(row) : 0, what);
}

}  // namespace eventcamera
