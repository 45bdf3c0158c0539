// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "src/formats/decoder.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/table_sample.hpp"
#include "src/formats/text/decimal.hpp"

namespace eventcamera {

/// Reads lines of text. Fields stand between commas, semicolons or blanks; lines that begin with #
/// or % are comments, and empty ones nothing.
///
/// What the settings leave open is found in the header and the first 256 lines:
/// - the columns, by a line of names; more columns than four are allowed there, and ignored. Where
///   there is none, by the numbers: TableSample;
/// - the unit of time, by its column's name or by the numbers. Whole numbers between blanks below
/// no
///   names may be microseconds (DVS-Voltmeter) or nanoseconds (rpg_esim): where they do not tell,
///   the file is refused. Finer digits are rounded to the nearest microsecond;
/// - the sensor's size, by %geometry:W,H, by names such as x@W and y@H, or by a first line W H.
///
/// Polarity is 0 or 1, -1 or 1, or false or true.
///
/// A header or a comment alone is a recording without events; a file of no bytes is none.
class CsvDecoder final : public Decoder {
 public:
  explicit CsvDecoder(const TableSettings& settings = {});

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override;
  void finish(Decoded& out) override;

 private:
  static constexpr std::size_t max_columns = 16;
  using Fields = std::array<std::string_view, max_columns>;

  struct Row {
    Decimal t = {};
    std::int64_t x = 0;
    std::int64_t y = 0;
    bool on = false;
  };

  static std::size_t split(std::string_view line, Fields& fields);
  static std::optional<Row> read_row(std::span<const std::string_view> fields,
                                     std::span<const std::optional<EventColumn>> columns,
                                     int power);
  std::size_t take_head(std::string_view text);
  void read_head();
  bool read_header_line(std::string_view line);
  void find_columns(const TableSample& sample);
  void find_unit(const TableSample& sample);

  void read_text(std::string_view text, Decoded& out);
  const char* read_lines(const char* at, const char* end, Decoded& out);
  const char* read_plain_line(const char* at, Row& row) const;
  void read_line(std::string_view line, Decoded& out);

  TableSettings settings_;
  bool in_head_ = true;
  std::string head_;            ///< the first lines, until it is known what they are
  std::size_t head_lines_ = 0;  ///< of them, those that may be events
  bool line_begins_ = true;     ///< the next character of the head is a line's first

  Columns columns_;
  bool has_names_ = false;        ///< in the header, one of each column
  std::optional<TimeUnit> unit_;  ///< that they tell
  char separator_ = ',';          ///< between the fields of the first line
  bool plain_ = false;            ///< four columns, so that most lines need not be split
  int power_ = 0;                 ///< of ten, from the time's unit to microseconds
  RowValidator validator_;

  std::string rest_;  ///< the beginning of a line whose end has not come
  bool skipping_ = false;
  std::uint64_t position_ = 0;  ///< of what is read next
};

}  // namespace eventcamera
