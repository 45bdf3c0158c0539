// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/formats/decoder.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/numpy/npy_header.hpp"

namespace eventcamera {

/// Returns a number, rounded as times are; nothing if it exceeds 64 bits.
std::optional<std::int64_t> npy_integer(const NpyField& field, const std::uint8_t* element);

/// Decodes NumPy files, versions 1.0 to 3.0: a structured array with fields t, x, y and p in any
/// order, or rows of numbers whose columns are detected from the first rows. Numbers are integers
/// or floating-point numbers of any width and byte order. The time unit is taken from the name of
/// the field, or detected from the first rows (TableSample). An array in which more than one row in
/// a hundred is not an event is refused.
class NpyDecoder final : public EventDecoder {
 public:
  explicit NpyDecoder(const TableSettings& settings = {});

  /// Reads only elements, as described by `header`. Throws UnsupportedFormat if their columns
  /// cannot be events.
  NpyDecoder(const NpyHeader& header, const TableSettings& settings);

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override;
  void finish(Decoded& out) override;
  bool is_table() const override { return true; }
  void decode_tail(ByteSource& source, Decoded& out) const override;

 private:
  void check_columns(std::size_t count) const;
  void decode_rows(std::span<const std::uint8_t> bytes, Decoded& out);
  void decode_columns(Decoded& out);
  void begin(NpyHeader header);
  void read_sample(Decoded& out);
  void find_layout(std::span<const std::uint8_t> elements);
  void note_unreadable(std::uint64_t rows_to_read);
  void read_elements(const std::uint8_t* bytes, std::uint64_t count, Decoded& out);

  TableSettings settings_;
  NpyPreamble preamble_;
  std::optional<NpyHeader> header_;
  std::size_t sample_bytes_ = 0;  ///< size of the first elements, to detect the layout
  bool layout_known_ = false;
  int power_ = 0;       ///< power of ten from the time unit to microseconds
  bool plain_ = false;  ///< all fields are little-endian integers, in elements of 8 bytes or more
  std::vector<std::uint8_t> rest_;  ///< first elements, or start of an element
  std::uint64_t position_ = 0;      ///< offset of the next byte to read
  std::uint64_t left_ = 0;          ///< remaining elements according to the header
  bool after_end_ = false;
  std::vector<std::uint8_t> columns_;  ///< an array by columns, which is collected as a whole
  PolarityCode polarities_;
  RowValidator validator_;
  UnreadableRows rows_;
};

}  // namespace eventcamera
