// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "src/core/event.hpp"
#include "src/formats/decoder.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/table_sample.hpp"
#include "src/formats/text/utf8_text.hpp"

namespace eventcamera {

/// Decimal number of a text, multiplied by a power of ten.
struct Decimal {
  std::int64_t value;  ///< rounded down, or up to the integer close above
  bool whole;          ///< no digits were cut off
  bool has_fraction;   ///< it has a decimal point or an exponent
};

/// Parses `text`, such as -12, 3.25 or 1e-6, multiplied by 10^`power`, without floating-point
/// arithmetic. Nothing if it is not entirely a number, or out of range.
///
/// Numbers with a fraction are rounded up by at most `max_rounding_up`.
std::optional<Decimal> read_decimal(std::string_view text, int power);

/// Reads typical lines of events fast: numbers without sign (except for the polarity), one
/// separator, no blanks.
class PlainLines {
 public:
  /// Maximum number of characters that read() examines.
  static constexpr std::ptrdiff_t reach = 128;

  struct Row {
    Microseconds t;
    std::int64_t x, y;
    bool on;
  };

  /// `columns` are t, x, y and p in any order. The time unit is 10^`power`
  /// microseconds.
  PlainLines(const Columns& columns, char separator, int power)
      : separator_(separator), power_(power) {
    std::ranges::transform(columns, columns_.begin(), [](const auto& column) { return *column; });
  }

  /// Returns the start of the next line, or nullptr if the line is not such a line.
  const char* read(const char* at, Row& row) const {
    std::array<std::uint64_t, event_columns> values;
    for (const auto& column : columns_) {
      auto& value = values[static_cast<std::size_t>(column)];
      if (column == EventColumn::p) {
        const bool minus = *at == '-';
        at += minus ? 1 : 0;
        const auto digit = static_cast<unsigned char>(*at++ - '0');
        if (digit > 1) return nullptr;
        value = minus ? 0 : digit;
      } else if (!read_integer(at, value) ||
                 (column == EventColumn::t && !read_microseconds(at, value))) {
        return nullptr;
      }
      if (&column != &columns_.back() && *at++ != separator_) return nullptr;
    }
    if (*at == '\r') ++at;
    if (*at++ != '\n') return nullptr;

    const auto number = [&](EventColumn column) {
      return static_cast<std::int64_t>(values[static_cast<std::size_t>(column)]);
    };
    row = {number(EventColumn::t), number(EventColumn::x), number(EventColumn::y),
           number(EventColumn::p) == 1};
    return at;
  }

 private:
  static constexpr std::uint64_t powers_of_ten[] = {
      1, 10, 100, 1'000, 10'000, 100'000, 1'000'000, 10'000'000, 100'000'000};

  /// Digits at the front of eight characters, and their value.
  struct Digits {
    unsigned count;
    std::uint64_t value;
  };

  static Digits read_digits(const char* at) {
    std::uint64_t word;
    std::memcpy(&word, at, sizeof word);
    word ^= 0x3030303030303030;
    // Non-digits are now above 9 and set the highest bit of their byte. Carries only affect later
    // bytes, and only the first non-digit counts.
    const auto others = ((word + 0x7676767676767676) | word) & 0x8080808080808080;
    const auto count = static_cast<unsigned>(std::countr_zero(others)) / 8;
    if (count == 0) return {0, 0};
    word <<= 64 - 8 * count;  // moves the last digit to the last byte, with zeros before the first
    // Combine neighbours to numbers of two, four and eight digits.
    word = word * 10 + (word >> 8);
    word = ((word & 0x000000ff000000ff) * 0x000f424000000064 +
            ((word >> 16) & 0x000000ff000000ff) * 0x0000271000000001) >>
           32;
    return {count, word};
  }

  /// Reads up to 16 digits; false if there are none, or more.
  static bool read_integer(const char*& at, std::uint64_t& value) {
    const auto digits = read_digits(at);
    at += digits.count;
    value = digits.value;
    if (digits.count < 8) return digits.count > 0;
    const auto more = read_digits(at);
    at += more.count;
    value = value * powers_of_ten[more.count] + more.value;
    return more.count < 8;
  }

  /// Converts the integer of a time to microseconds, and adds its decimals if it is in seconds;
  /// false if that may be inexact.
  bool read_microseconds(const char*& at, std::uint64_t& value) const {
    constexpr std::uint64_t max_value = 1'000'000'000'000;
    if (power_ == 6) {
      if (value > max_value) return false;
      value *= 1'000'000;
      if (*at != '.') return true;
      ++at;
      const auto digits = read_digits(at);
      at += digits.count;
      if (digits.count == 8) at += read_digits(at).count;
      const auto fraction = digits.value * powers_of_ten[8 - digits.count];
      value += (fraction + static_cast<std::uint64_t>(100 * max_rounding_up)) / 100;
    } else if (power_ == 3) {
      if (value > max_value) return false;
      value *= 1000;
    } else if (power_ == -3) {
      value /= 1000;
    }
    return true;
  }

  std::array<EventColumn, event_columns> columns_;
  char separator_;
  int power_;
};

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
