// SPDX-License-Identifier: LGPL-2.1-or-later
// Events as rows of numbers, as in text, NumPy arrays and HDF5.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "src/core/label.hpp"
#include "src/core/sensor_size.hpp"
#include "src/formats/corruption.hpp"

namespace eventcamera {

/// Columns of a table of events: of the event, and of its label.
enum class EventColumn : std::uint8_t { t, x, y, p, cause, object_class };

constexpr std::size_t event_columns = 4;  ///< without labels
constexpr std::size_t all_columns = 6;

enum class TimeUnit : std::uint8_t { seconds, milliseconds, microseconds, nanoseconds };

/// Power of ten that converts this unit to microseconds.
constexpr int power_of(TimeUnit unit) {
  constexpr int powers[] = {6, 3, 0, -3};
  return powers[static_cast<std::size_t>(unit)];
}

/// Meaning of a column name.
struct ColumnName {
  EventColumn column;
  std::optional<TimeUnit> unit = std::nullopt;  ///< for times
};

/// Returns the column for a name used by any tool, ignoring case, as in x, event_x, x_coords and
/// TD.x. Times may have a unit, as in t_ns and "time [s]"; anything else from a space, '@', '[' or
/// '(' on is ignored.
std::optional<ColumnName> column_named(std::string_view name);

/// Times with a fraction are rounded down to microseconds, or up to one at most this far above:
/// programs print and store 33e-6 s as slightly less.
constexpr double max_rounding_up = 0.25;

/// Meaning of each column of a table; columns without a value are ignored.
using Columns = std::vector<std::optional<EventColumn>>;

/// Parses letters such as "txyp", with '-' for ignored columns; nothing unless each of t, x, y and
/// p occurs exactly once.
std::optional<Columns> columns_of(std::string_view letters);

/// Label from the numbers of its columns; numbers that a label cannot hold become 0, unknown.
inline Label label_from(std::int64_t cause, std::int64_t object_class) {
  const bool is_cause = cause >= 0 && cause <= UINT8_MAX;
  const bool is_class = object_class >= 0 && object_class <= UINT16_MAX;
  return {.object_class = static_cast<std::uint16_t>(is_class ? object_class : 0),
          .cause = static_cast<Cause>(is_cause ? cause : 0)};
}

/// Meaning of the numbers in a column of polarities.
class PolarityCode {
 public:
  void count(double number);

  /// Chooses between 1 = ON, with 0 or -1 for OFF, and 2 = ON with 1 = OFF, by the counted numbers.
  /// Throws UnsupportedFormat, which lists them, if they are ambiguous.
  void choose();

  bool is_one_two() const { return on_ == 2; }

  /// Nothing if the number is not a polarity.
  std::optional<bool> is_on(std::int64_t number) const {
    if (number == on_) return true;
    if (is_one_two()) return number == 1 ? std::optional(false) : std::nullopt;
    if (number == 0 || is_minus_one(number)) return false;
    return std::nullopt;
  }

 private:
  /// Also true for -1 as an unsigned number of 8, 16 or 32 bits.
  static constexpr bool is_minus_one(std::int64_t number) {
    return number == -1 || number == UINT8_MAX || number == UINT16_MAX || number == UINT32_MAX;
  }

  std::int64_t on_ = 1;
  std::uint64_t rows_ = 0;
  std::array<std::uint64_t, 3> counts_{};  ///< of 0, 1 and 2
  std::uint64_t minus_ones_ = 0;
  std::uint64_t unsigned_ = 0;  ///< -1 as an unsigned number
  std::string others_;          ///< some of the other numbers
  std::uint64_t other_rows_ = 0;
};

/// Counts rows that are not events. A table with more than one in a hundred is refused: it probably
/// has another format.
class UnreadableRows {
 public:
  void count(std::uint64_t rows) { rows_ += rows; }

  /// Counts the last row as unreadable; `what` describes it.
  void add(std::string what) {
    if (unreadable_++ == 0) first_ = std::move(what);
  }

  /// Throws UnsupportedFormat if there are too many. While rows follow, some are always tolerated.
  void check(bool ended) const;

  std::uint64_t rows() const { return rows_; }

 private:
  std::uint64_t rows_ = 0;
  std::uint64_t unreadable_ = 0;
  std::string first_;
};

/// Known properties of a table; the others are detected from its header and first rows.
struct TableSettings {
  Columns columns = {};
  std::optional<TimeUnit> unit = std::nullopt;
  SensorSize size = {};  ///< 0x0: as stated in the header
};

/// Makes events from the numbers of rows. Events outside the sensor are dropped, events earlier
/// than a previous one are kept, and both are counted.
class RowValidator {
 public:
  /// 0x0 means unknown: coordinates below max_side are inside.
  void set_size(SensorSize size) {
    x_end_ = size.width > 0 ? static_cast<std::uint64_t>(std::min(size.width, max_side)) : max_side;
    y_end_ =
        size.height > 0 ? static_cast<std::uint64_t>(std::min(size.height, max_side)) : max_side;
  }

  void append(Microseconds t, std::int64_t x, std::int64_t y, bool on,
              std::vector<AbsoluteEvent>& out, Corruption& corruption) {
    append(t, x, y, on, {}, out, corruption);
  }

  void append(Microseconds t, std::int64_t x, std::int64_t y, bool on, const Label& label,
              std::vector<AbsoluteEvent>& out, Corruption& corruption) {
    if (static_cast<std::uint64_t>(x) >= x_end_ || static_cast<std::uint64_t>(y) >= y_end_) {
      ++corruption.outside;
      return;
    }
    out.push_back(
        {t, static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y | (on ? 0x8000 : 0))});
    set_label(out.back(), label);
  }

 private:
  std::uint64_t x_end_ = max_side, y_end_ = max_side;
};

struct TableNumber {
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
