// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "src/formats/decoder.hpp"
#include "src/formats/event_decoder.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/table_sample.hpp"
#include "src/formats/text/decimal.hpp"
#include "src/formats/text/plain_lines.hpp"

namespace eventcamera {

/// Decodes lines of text. Fields are separated by commas, semicolons or blanks; lines starting with
/// # or % are comments; empty lines are ignored.
///
/// Properties not given in the settings are detected from the header and the first 256 lines:
/// - the columns, by a line of names, which may include those of labels, cause and class, and
///   further ones that are ignored, or by the numbers (TableSample);
/// - the time unit, by the name of its column or by the numbers. Integer times in blank-separated
///   columns without names may be microseconds (DVS-Voltmeter) or nanoseconds (rpg_esim); an
///   ambiguous file is refused. Times are rounded down to microseconds;
/// - the sensor size, by %geometry:W,H, by names such as x@W and y@H, or by a first line W H.
///
/// Polarity is 0/1, -1/1 or false/true.
///
/// A file with only a header or comments, or with nothing, is a recording without events.
class CsvDecoder final : public EventDecoder {
 public:
  explicit CsvDecoder(const TableSettings& settings = {});

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override;
  void finish(Decoded& out) override;

  /// True if the first line names the columns.
  bool has_names() const { return has_names_; }

 private:
  static constexpr std::size_t max_columns = 16;
  using Fields = std::array<std::string_view, max_columns>;

  struct Row {
    Decimal t = {};
    std::int64_t x = 0;
    std::int64_t y = 0;
    bool on = false;
    std::int64_t cause = 0;
    std::int64_t object_class = 0;
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
  void read_line(std::string_view line, Decoded& out);

  TableSettings settings_;
  bool in_head_ = true;
  std::string head_;            ///< first lines, until they are interpreted
  std::size_t head_lines_ = 0;  ///< number of lines in it that may be events
  bool line_begins_ = true;     ///< the next character is the first of a line

  Columns columns_;
  bool has_names_ = false;                 ///< the header has column names
  bool has_geometry_ = false;              ///< the header is OpenEB's for x,y,p,t
  std::optional<TimeUnit> unit_;           ///< time unit in the names
  char separator_ = ',';                   ///< separator in the first line
  int power_ = 0;                          ///< power of ten from the time unit to microseconds
  std::optional<PlainLines> plain_lines_;  ///< if there are four columns
  RowValidator validator_;

  std::string rest_;  ///< start of an incomplete line
  bool skipping_ = false;
  std::uint64_t position_ = 0;  ///< offset of the next byte to read
};

}  // namespace eventcamera
