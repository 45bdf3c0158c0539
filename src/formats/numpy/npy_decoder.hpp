// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <optional>

#include "src/formats/decoder.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/numpy/npy_header.hpp"

namespace eventcamera {

/// Reads NumPy's format, versions 1.0 to 3.0: a structured array with fields t, x, y and p in any
/// order, or rows of numbers whose columns are found by the first rows. Numbers are integers or
/// floating-point numbers of any width and byte order. The unit of time is told by the name of its
/// field, or found by the first rows: TableSample. Polarity is ON where it is more than 0.
class NpyDecoder final : public Decoder {
 public:
  explicit NpyDecoder(const TableSettings& settings = {});

  /// Reads elements only, as a header would tell of them.
  NpyDecoder(const NpyHeader& header, const TableSettings& settings);

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override;
  void finish(Decoded& out) override;

 private:
  void begin(NpyHeader header);
  void read_sample(Decoded& out);
  void find_layout(std::span<const std::uint8_t> elements);
  void read_elements(const std::uint8_t* bytes, std::uint64_t count, Decoded& out);

  TableSettings settings_;
  NpyPreamble preamble_;
  std::optional<NpyHeader> header_;
  std::size_t sample_bytes_ = 0;  ///< of the first elements, which tell the layout
  bool layout_known_ = false;
  int power_ = 0;       ///< of ten, from the time's unit to microseconds
  bool plain_ = false;  ///< all fields are little-endian integers, 8 bytes or more together
  std::vector<std::uint8_t> rest_;  ///< the first elements, or the beginning of one
  std::uint64_t position_ = 0;      ///< of what is read next
  std::uint64_t left_ = 0;          ///< elements that the header claims and that have not come
  bool after_end_ = false;
  RowValidator validator_;
};

}  // namespace eventcamera
