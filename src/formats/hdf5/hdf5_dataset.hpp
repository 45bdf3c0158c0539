// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "src/formats/hdf5/hdf5_handle.hpp"

namespace eventcamera {

/// Dataset with rows of integers in an untrusted file. Ensures that it is stored in the file
/// itself, chunk sizes are bounded, and there are no more rows than are stored.
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
  bool is_integers() const { return !numbers_.empty() && !seconds_column_; }
  bool is_unsigned_32() const {
    return is_integers() && numbers_[0].bytes == 4 && !numbers_[0].is_signed;
  }

  /// Selects the members of a compound type to read. Throws UnsupportedFormat if one is missing or
  /// not an integer.
  void choose(std::span<const char* const> members);

  /// Reads numbers of 64-bit floating point, of which those in one column are seconds and are
  /// read as microseconds; fractions of others are cut off. False if the dataset has others.
  bool read_fractions(std::size_t seconds_column);

  /// Reads rows, with all columns or the chosen members. False if the file is corrupt there.
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
  /// Integer within an element.
  struct Number {
    std::size_t offset = 0;
    std::size_t bytes = 0;
    bool is_signed = false;
    bool big_endian = false;
  };

  static std::optional<Number> number_of(hid_t type);
  template <class Unsigned>
  void widen(const std::uint8_t* element, const Number& number, std::span<std::int64_t> out) const;
  void round_fractions(std::span<std::int64_t> numbers) const;
  void check_chunks();
  void check_storage(hid_t file);

  bool read_stored(const hsize_t* offset, std::size_t max_stored, std::vector<std::uint8_t>& out,
                   std::uint32_t& filter_mask);
  bool load(std::uint64_t block);
  bool read_elements(std::uint64_t first, std::uint64_t count, std::vector<std::uint8_t>& out);

  std::string path_;
  Hdf5Handle dataset_, type_, creation_;
  std::size_t type_bytes_ = 0;                 ///< size of an element
  std::optional<std::size_t> seconds_column_;  ///< of fractional numbers
  std::vector<Number> numbers_;                ///< numbers to read of each element
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

}  // namespace eventcamera
