// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "src/formats/decoder.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/table_sample.hpp"
#include "src/formats/text/decimal.hpp"
#include "src/formats/text/plain_lines.hpp"
#include "src/formats/text/utf8_text.hpp"

namespace eventcamera {

/// Decodes lines of text, in UTF-8 or, with a byte order mark, UTF-16. Fields are separated by
/// commas, semicolons or blanks, and may be quoted; lines starting with # or % are comments; empty
/// lines are ignored. Between semicolons, blanks or quotes, numbers may have decimal commas or
/// commas before thousands.
///
/// Properties not given in the settings are detected from the header and the first 256 lines:
/// - the columns, by a line of names, which may include labels, cause and class, and
///   further columns that are ignored, by names in a comment, or by the numbers (TableSample);
/// - the time unit, by the name of its column or by the numbers. Integer times in blank-separated
///   columns without names may be microseconds (DVS-Voltmeter) or nanoseconds (rpg_esim); an
///   ambiguous file is refused. Times are rounded as by read_decimal();
/// - the sensor size, by %geometry:W,H, by names such as x@W and y@H, or by a first line W H.
///
/// Polarity is 0/1, -1/1, 1/2 (PolarityCode), or in words: false/true, OFF/ON, neg/pos.
///
/// A table in which more than one line in a hundred is not an event is refused.
///
/// A file with only a header or comments, or with nothing, is a recording without events.
class CsvDecoder final : public EventDecoder {
 public:
  explicit CsvDecoder(const TableSettings& settings = {});

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override;
  void finish(Decoded& out) override;
  bool is_table() const override { return true; }

  /// True if the first line names the columns t, x, y and p.
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

  /// Meaning of commas in numbers.
  enum class Commas : std::uint8_t { none, decimal, grouping };

  static std::size_t split(std::string_view line, bool are_names, Fields& fields);
  void find_commas(const std::vector<std::vector<std::string_view>>& rows);
  std::string_view plain_number(std::string_view field, std::string& buffer) const;
  std::optional<Row> read_row(std::span<const std::string_view> fields) const;
  std::size_t append_head(std::string_view text);
  void read_head();
  bool read_header_line(std::string_view line);
  Columns columns_named(std::span<const std::string_view> names);
  bool are_all_named() const;
  void read_names_in_comment(std::string_view line);
  void find_columns(const TableSample& sample);
  void find_unit(const TableSample& sample);

  void read_text(std::string_view text, Decoded& out);
  const char* read_lines(const char* at, const char* end, Decoded& out);
  void read_line(std::string_view line, Decoded& out);

  TableSettings settings_;
  Utf8Text utf8_;
  bool in_head_ = true;
  std::string head_;            ///< first lines, until they are interpreted
  std::size_t head_lines_ = 0;  ///< number of lines in it that may be events
  bool line_begins_ = true;     ///< the next character is the first of a line

  Columns columns_;
  bool has_names_ = false;                 ///< the header has column names
  bool is_named_txyp_ = false;             ///< as in the tables that this project writes
  bool has_geometry_ = false;              ///< the header is OpenEB's for x,y,p,t
  std::optional<TimeUnit> unit_;           ///< time unit in the names
  char separator_ = ',';                   ///< separator in the first line
  int power_ = 0;                          ///< power of ten from the time unit to microseconds
  std::optional<PlainLines> plain_lines_;  ///< if there are four columns
  Commas commas_ = Commas::none;
  PolarityCode polarities_;
  RowValidator validator_;
  UnreadableRows rows_;
  std::uint64_t lines_ = 0;  ///< lines read

  std::string rest_;  ///< start of an incomplete line
  bool skipping_ = false;
  std::uint64_t position_ = 0;  ///< offset of the next byte to read
};

}  // namespace eventcamera
