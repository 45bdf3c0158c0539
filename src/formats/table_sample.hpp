// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "src/formats/event_table.hpp"

namespace eventcamera {

/// A number in a row of a table.
struct TableNumber {
  /// How it is written.
  enum class Form : std::uint8_t {
    integer,
    decimals,  ///< two or more, as in 0.003820
    floating,  ///< with an exponent, with one decimal, or in binary
  };

  double value;  ///< not a number where the field is something else
  Form form = Form::integer;
};

/// The first rows of a table, by which its columns and its unit of time are found where nothing
/// else tells them.
class TableSample {
 public:
  using Row = std::vector<TableNumber>;

  /// Rows enough to tell.
  static constexpr std::size_t max_rows = 256;

  void add(Row row) { rows_.push_back(std::move(row)); }
  bool empty() const { return rows_.empty(); }

  /// Whether a row is an event of these columns.
  bool has_events(const Columns& columns) const { return !times_of(columns).empty(); }

  /// Whether every row has this many numbers.
  bool has_columns(std::size_t count) const;

  /// The time is the column that alone has fractions; else the first of txyp, xypt and xytp is
  /// taken in which p is a polarity, x and y are coordinates and t never decreases. A column that
  /// counts rows may come first. Nothing where no order fits.
  std::optional<Columns> find_columns() const;

  /// Seconds where a time has a fraction. Whole numbers are microseconds, and nanoseconds where
  /// only these can be a date. Where `is_either`, it takes more to tell these apart: nothing where
  /// the times do not tell.
  std::optional<TimeUnit> find_unit(const Columns& columns, bool is_either) const;

 private:
  bool counts_rows() const;
  std::vector<TableNumber> times_of(const Columns& columns) const;

  std::vector<Row> rows_;
};

}  // namespace eventcamera
