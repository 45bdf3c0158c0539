// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "src/formats/event_table.hpp"

namespace eventcamera {

/// Number in a row of a table.
struct TableNumber {
  /// Notation of the number.
  enum class Form : std::uint8_t {
    integer,
    decimals,  ///< two or more, as in 0.003820
    floating,  ///< with an exponent, with one decimal, or in binary
  };

  double value;  ///< NaN if the field is not a number
  Form form = Form::integer;
};

/// The first rows of a table, to detect columns and time unit that nothing else states.
class TableSample {
 public:
  using Row = std::vector<TableNumber>;

  /// Number of rows sufficient for detection.
  static constexpr std::size_t max_rows = 256;
  static constexpr std::size_t max_binary_rows = 4096;  ///< of files with random access

  void add(Row row) { rows_.push_back(std::move(row)); }
  bool empty() const { return rows_.empty(); }

  /// True if any row is an event with these columns.
  bool has_events(const Columns& columns) const { return !times_of(columns).empty(); }

  /// True if every row has this many fields.
  bool has_columns(std::size_t count) const;

  /// True if there are several rows with this many fields, and the first one counts them, like an
  /// index of pandas.
  bool counts_rows(std::size_t columns) const;

  /// Detects the columns. If only one column has fractions, it is the time. Otherwise returns the
  /// first of txyp, xypt and xytp for which p is a polarity, x and y are coordinates and t never
  /// decreases; with `is_xypt`, xypt is tried first. A column that counts rows may precede them.
  /// Nothing if no order fits.
  std::optional<Columns> find_columns(bool is_xypt = false) const;

  /// Detects the time unit: seconds if a time has a fraction; otherwise microseconds, or
  /// nanoseconds if only these give a plausible date. If `is_either`, the gaps between times decide
  /// between the two. Nothing if they are ambiguous, if events were too far apart in this unit, or
  /// if the times seem to be numbers of frames. `may_be_own`: it has the names or types of a
  /// table that this project writes, whose events may be far apart if their polarity is 0 or 1.
  std::optional<TimeUnit> find_unit(const Columns& columns, bool is_either,
                                    bool may_be_own = false) const;

  /// Detects the meaning of the polarities. Throws UnsupportedFormat if it is ambiguous.
  PolarityCode find_polarities(const Columns& columns) const;

 private:
  std::vector<TableNumber> times_of(const Columns& columns) const;
  std::optional<TimeUnit> guessed_unit(const Columns& columns, bool is_either,
                                       const std::vector<TableNumber>& times) const;

  std::vector<Row> rows_;
};

}  // namespace eventcamera
