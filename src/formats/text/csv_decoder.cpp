// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/text/csv_decoder.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "src/core/sensor_size.hpp"

namespace eventcamera {

namespace {

constexpr bool is_digit(char letter) {
  return letter >= '0' && letter <= '9';
}

/// Parses digits, saturating at a limit that no valid exponent reaches.
int read_exponent(std::string_view digits) {
  int number = 0;
  for (const auto digit : digits) number = std::min(number * 10 + (digit - '0'), 100'000);
  return number;
}

/// digits * 10^power, as a text has it.
struct Number {
  bool negative = false;
  std::uint64_t digits = 0;
  int power = 0;
  bool whole = true;  ///< no digits were cut off
  bool has_fraction = false;
};

/// Nothing if the text is not entirely a number.
std::optional<Number> parsed(std::string_view text) {
  std::size_t at = 0;
  const auto more = [&] { return at < text.size(); };
  const auto read_sign = [&] {
    const bool is_sign = more() && (text[at] == '-' || text[at] == '+');
    return is_sign && text[at++] == '-';
  };
  Number number{.negative = read_sign()};
  // Up to 19 digits are exact in 64 bits.
  constexpr auto room = std::numeric_limits<std::uint64_t>::max() / 10 - 1;
  bool any = false;
  for (; more(); ++at) {
    if (text[at] == '.' && !number.has_fraction) {
      number.has_fraction = true;
      continue;
    }
    if (!is_digit(text[at])) break;
    any = true;
    if (number.digits <= room) {
      number.digits = number.digits * 10 + static_cast<std::uint64_t>(text[at] - '0');
      number.power -= number.has_fraction ? 1 : 0;
    } else {
      number.whole = number.whole && text[at] == '0';
      number.power += number.has_fraction ? 0 : 1;
    }
  }
  if (!any) return std::nullopt;
  if (more() && (text[at] == 'e' || text[at] == 'E')) {
    ++at;
    number.has_fraction = true;
    const bool down = read_sign();
    const auto rest = text.substr(at);
    if (rest.empty() || !std::ranges::all_of(rest, is_digit)) return std::nullopt;
    number.power += down ? -read_exponent(rest) : read_exponent(rest);
    at = text.size();
  }
  if (more()) return std::nullopt;
  return number;
}

/// Nothing if the number is out of range.
std::optional<Decimal> rounded_down(const Number& number) {
  auto [negative, digits, power, whole, has_fraction] = number;
  constexpr auto max = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
  for (; power > 0 && digits != 0; --power) {
    if (digits > max / 10) return std::nullopt;
    digits *= 10;
  }
  // Cuts off digits: the fraction is rest / scale.
  auto rest = 0.0;
  auto scale = 1.0;
  for (; power < 0 && digits != 0; ++power, scale *= 10) {
    rest += static_cast<double>(digits % 10) * scale;
    digits /= 10;
  }
  whole = whole && rest == 0;
  if (digits >= max && !whole) return std::nullopt;
  if (digits > max) return std::nullopt;
  const double rounding_up = has_fraction ? max_rounding_up * scale : 0;
  const bool up = negative ? !whole && rest > rounding_up : scale - rest <= rounding_up;
  const auto value = static_cast<std::int64_t>(digits + (up ? 1 : 0));
  return Decimal{negative ? -value : value, whole, has_fraction};
}

constexpr std::size_t head_lines = 256;
constexpr std::size_t max_head = 65536;
constexpr std::size_t max_line = 4096;

constexpr bool is_blank(char letter) {
  return letter == ' ' || letter == '\t' || letter == '\r';
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

bool is_word(std::string_view text, std::string_view word) {
  return std::ranges::equal(text, word, {}, [](char letter) {
    return letter >= 'A' && letter <= 'Z' ? static_cast<char>(letter - 'A' + 'a') : letter;
  });
}

bool is_comment(std::string_view line) {
  return line.empty() || line.front() == '#' || line.front() == '%';
}

std::optional<int> read_extent(std::string_view text) {
  const auto number = read_decimal(trimmed(text), 0);
  if (!number || number->has_fraction || number->value <= 0 || number->value > max_side)
    return std::nullopt;
  return static_cast<int>(number->value);
}

/// 0x0 if one of the texts is not a valid extent.
SensorSize read_size(std::string_view width, std::string_view height) {
  const SensorSize size{read_extent(width).value_or(0), read_extent(height).value_or(0)};
  return size.width > 0 && size.height > 0 ? size : SensorSize{};
}

/// Polarity in words, such as true and OFF.
std::optional<bool> polarity_word(std::string_view text) {
  for (const std::string_view word : {"true", "on", "pos", "positive", "+"})
    if (is_word(text, word)) return true;
  for (const std::string_view word : {"false", "off", "neg", "negative", "-"})
    if (is_word(text, word)) return false;
  return std::nullopt;
}

std::string_view unquoted(std::string_view field) {
  if (field.size() < 2 || (field.front() != '"' && field.front() != '\'') ||
      field.back() != field.front())
    return field;
  return trimmed(field.substr(1, field.size() - 2));
}

/// True if two fields are separated by blanks only, as in "0,5 10 20 1" but not in "1, 2, 3".
bool has_lone_blank(std::string_view line) {
  bool is_quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"') is_quoted = !is_quoted;
    if (is_quoted || !is_blank(line[i])) continue;
    const auto next = line.find_first_not_of(" \t\r", i);
    if (line[i - 1] != ',' && line[next] != ',') return true;
    i = next - 1;
  }
  return false;
}

/// Returns ';', ',' or ' ', which stands for any blanks.
char separator_of(std::string_view trimmed_line, bool are_names) {
  if (trimmed_line.find(';') != std::string_view::npos) return ';';
  if (trimmed_line.find(',') == std::string_view::npos) return ' ';
  return !are_names && has_lone_blank(trimmed_line) ? ' ' : ',';
}

bool is_letter(char letter) {
  letter = static_cast<char>(letter | 0x20);
  return letter >= 'a' && letter <= 'z';
}

TableNumber sample_of(std::string_view field) {
  if (const auto on = polarity_word(field)) return {*on ? 1.0 : 0.0};
  const auto decimal = read_decimal(field, 0);
  if (!decimal) return {std::numeric_limits<double>::quiet_NaN()};
  if (!decimal->has_fraction) return {static_cast<double>(decimal->value)};
  double value = 0;
  if (field.front() == '+') field.remove_prefix(1);
  std::from_chars(field.data(), field.data() + field.size(), value);
  const auto point = field.find('.');
  const bool has_decimals = point != std::string_view::npos && field.size() - point > 2 &&
                            field.find_first_of("eE") == std::string_view::npos;
  return {value, has_decimals ? TableNumber::Form::decimals : TableNumber::Form::floating};
}

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

/// Converts text in pieces of any size to UTF-8, if it begins with a byte order mark of UTF-16;
/// other text is left as it is. Characters past U+FFFF become question marks.
class Utf8Text {
 public:
  /// Returns `bytes` as UTF-8; the text is valid as long as `bytes` and `converted`.
  std::string_view text_of(std::span<const std::uint8_t> bytes, std::string& converted) {
    if (encoding_ == Encoding::unknown) {
      start_.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
      if (start_.size() < 2) return {};
      encoding_ = start_.starts_with("\xff\xfe")   ? Encoding::utf16_little
                  : start_.starts_with("\xfe\xff") ? Encoding::utf16_big
                                                   : Encoding::utf8;
      if (encoding_ != Encoding::utf8) start_.erase(0, 2);
      converted.swap(start_);
      if (encoding_ == Encoding::utf8) return converted;
      const std::string units = std::move(converted);
      converted.clear();
      convert({reinterpret_cast<const std::uint8_t*>(units.data()), units.size()}, converted);
      return converted;
    }
    if (encoding_ == Encoding::utf8)
      return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
    convert(bytes, converted);
    return converted;
  }

  /// The text, if it has only one byte.
  std::string_view rest() const { return start_; }

 private:
  enum class Encoding : std::uint8_t { unknown, utf8, utf16_little, utf16_big };

  void convert(std::span<const std::uint8_t> bytes, std::string& out) {
    for (const std::uint32_t byte : bytes) {
      if (!half_) {
        half_ = byte;
        continue;
      }
      append(encoding_ == Encoding::utf16_little ? *half_ | byte << 8 : *half_ << 8 | byte, out);
      half_.reset();
    }
  }

  static void append(std::uint32_t unit, std::string& out) {
    if (unit < 0x80) {
      out += static_cast<char>(unit);
    } else if (unit < 0x800) {
      out += static_cast<char>(0xc0 | unit >> 6);
      out += static_cast<char>(0x80 | (unit & 0x3f));
    } else if (unit >= 0xd800 && unit < 0xe000) {
      if (unit < 0xdc00) out += '?';  // once for both halves
    } else {
      out += static_cast<char>(0xe0 | unit >> 12);
      out += static_cast<char>(0x80 | (unit >> 6 & 0x3f));
      out += static_cast<char>(0x80 | (unit & 0x3f));
    }
  }

  Encoding encoding_ = Encoding::unknown;
  std::string start_;                  ///< first byte, until the encoding is known
  std::optional<std::uint32_t> half_;  ///< first byte of a character
};

class CsvDecoder final : public EventDecoder {
 public:
  explicit CsvDecoder(const TableSettings& settings) : settings_(settings) {}

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override {
    std::string converted;
    auto text = utf8_.text_of(bytes, converted);
    if (in_head_) {
      const auto count = append_head(text);
      if (head_lines_ < head_lines && head_.size() < max_head) return;
      text.remove_prefix(count);
      read_head();
      const auto head = std::move(head_);
      read_text(std::string_view(head).substr(static_cast<std::size_t>(position_)), out);
      rows_.check(true);
    }
    read_text(text, out);
    rows_.check(false);
  }

  void finish(Decoded& out) override {
    if (in_head_) {
      head_ += utf8_.rest();
      head_ += '\n';
      read_head();
      head_.pop_back();
      position_ = std::min<std::uint64_t>(position_, head_.size());
      const auto head = std::move(head_);
      read_text(std::string_view(head).substr(static_cast<std::size_t>(position_)), out);
    }
    rows_.check(true);
    // A last line without an end may be cut off.
    if (!rest_.empty()) read_line(rest_, out);
    position_ += rest_.size();
    rest_.clear();
  }

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

  /// Splits a line into fields without quotes, and returns their number; 0 if there are too many.
  /// An empty last field is ignored: some programs end lines with a separator.
  static std::size_t split(std::string_view line, bool are_names, Fields& fields) {
    std::size_t count = 0;
    line = trimmed(line);
    const char separator = separator_of(line, are_names);
    while (true) {
      if (count == fields.size()) return 0;
      auto end = std::string_view::npos;
      char quote = 0;
      for (std::size_t i = 0; i < line.size() && end == std::string_view::npos; ++i) {
        if (quote == 0 && (line[i] == '"' || (line[i] == '\'' && i == 0)))
          quote = line[i];
        else if (line[i] == quote)
          quote = 0;
        else if (quote == 0 && (line[i] == separator || (separator == ' ' && is_blank(line[i]))))
          end = i;
      }
      fields[count++] = unquoted(trimmed(line.substr(0, end)));
      if (end == std::string_view::npos) break;
      line.remove_prefix(end + 1);
      if (separator == ' ') line = trimmed(line);
    }
    if (count > 1 && fields[count - 1].empty()) --count;
    return count;
  }

  /// Detects the meaning of commas in numbers. Throws UnsupportedFormat if it is ambiguous.
  void find_commas(const std::vector<std::vector<std::string_view>>& rows) {
    bool is_decimal = false;
    bool is_grouping = false;
    std::string_view either;
    for (const auto& row : rows)
      for (const auto field : row) {
        const auto comma = field.find(',');
        if (comma == std::string_view::npos || comma == 0) continue;
        const auto digits = field.substr(field.front() == '-' ? 1 : 0);
        const auto after = field.substr(comma + 1);
        if (after.find(',') != std::string_view::npos ||
            (after.find('.') != std::string_view::npos && after.find('.') == 3))
          is_grouping = true;
        else if (after.size() != 3 || digits.front() == '0' || digits.find(',') > 3)
          is_decimal = true;
        else
          either = field;
      }
    if (is_decimal && is_grouping)
      throw UnsupportedFormat(
          "numbers have commas before decimals and before thousands; write a decimal point, and no "
          "separators of thousands");
    if (!is_decimal && !is_grouping && !either.empty())
      throw UnsupportedFormat("the comma in " + std::string(either) +
                              " may be before decimals or thousands; write a decimal point, and no "
                              "separators of thousands");
    commas_ = is_decimal ? Commas::decimal : is_grouping ? Commas::grouping : Commas::none;
  }

  /// Returns the number in a field without separators of thousands, and with a decimal point.
  std::string_view plain_number(std::string_view field, std::string& buffer) const {
    if (field.find_first_of(commas_ == Commas::none ? "'" : ",'") == std::string_view::npos)
      return field;
    const bool has_comma = field.find(',') != std::string_view::npos;
    buffer.clear();
    for (const char letter : field) {
      const bool is_group = letter == '\'' || (commas_ == Commas::grouping && letter == ',') ||
                            (commas_ == Commas::decimal && has_comma && letter == '.');
      if (!is_group) buffer += commas_ == Commas::decimal && letter == ',' ? '.' : letter;
    }
    return buffer;
  }

  std::optional<Row> read_row(std::span<const std::string_view> fields) const {
    if (fields.size() != columns_.size()) return std::nullopt;
    Row row;
    std::string buffer;
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (!columns_[i]) continue;
      const auto column = *columns_[i];
      const auto field = plain_number(fields[i], buffer);
      const auto number = read_decimal(field, column == EventColumn::t ? power_ : 0);
      if (column == EventColumn::p) {
        auto on = polarity_word(field);
        if (number && number->whole) on = polarities_.is_on(number->value);
        if (!on) return std::nullopt;
        row.on = *on;
        continue;
      }
      if (column > EventColumn::p) {  // a label, which may be missing
        auto& label = column == EventColumn::cause ? row.cause : row.object_class;
        label = number && number->whole ? number->value : 0;
        continue;
      }
      if (!number) return std::nullopt;
      if (column == EventColumn::t) {
        row.t = *number;
        continue;
      }
      if (!number->whole) return std::nullopt;
      (column == EventColumn::x ? row.x : row.y) = number->value;
    }
    return row;
  }

  /// Appends `text` to the head, up to the head's end, and returns the number of characters
  /// appended.
  std::size_t append_head(std::string_view text) {
    std::size_t count = 0;
    while (count < text.size() && head_lines_ < head_lines && head_.size() < max_head) {
      const char letter = text[count++];
      head_ += letter;
      if (line_begins_ && letter != '#' && letter != '%' && letter != '\n') ++head_lines_;
      line_begins_ = letter == '\n';
    }
    return count;
  }

  /// Interprets the lines of the head and finds the start of the events.
  void read_head() {
    in_head_ = false;
    std::vector<std::vector<std::string_view>> rows;
    std::string_view text = head_;
    constexpr std::string_view byte_order_mark = "\xef\xbb\xbf";
    if (text.starts_with(byte_order_mark)) text.remove_prefix(byte_order_mark.size());
    position_ = head_.size() - text.size();
    const bool empty = text.find_first_not_of(" \t\r\n") == std::string_view::npos;
    while (true) {
      const auto end = text.find('\n');
      if (end == std::string_view::npos) break;
      const auto line = trimmed(text.substr(0, end));
      text.remove_prefix(end + 1);
      const bool header = rows.empty() && read_header_line(line);
      if (header) {
        position_ = head_.size() - text.size();
        ++lines_;
      }
      if (header || is_comment(line)) continue;
      if (rows.empty()) {
        separator_ = separator_of(line, false);
        if (separator_ == ' ')
          separator_ = line[std::min(line.find_first_of(" \t"), line.size() - 1)];
      }
      Fields fields;
      const auto count = split(line, false, fields);
      rows.emplace_back(fields.begin(), fields.begin() + static_cast<std::ptrdiff_t>(count));
    }
    if (!empty && text.size() == head_.size())
      throw UnsupportedFormat("not CSV events: no line ends");

    if (settings_.size != SensorSize{}) stream_.size = settings_.size;
    validator_.set_size(stream_.size);
    find_commas(rows);
    TableSample sample;
    std::string buffer;
    for (const auto& row : rows) {
      TableSample::Row numbers;
      for (const auto field : row) numbers.push_back(sample_of(plain_number(field, buffer)));
      sample.add(std::move(numbers));
    }
    find_columns(sample);
    find_unit(sample);
    if (!sample.empty()) polarities_ = sample.find_polarities(columns_);
    stream_.labelled = std::ranges::any_of(
        columns_, [](auto column) { return column && *column > EventColumn::p; });
    if (columns_.size() == event_columns && !stream_.labelled && !polarities_.is_one_two())
      plain_lines_.emplace(columns_, separator_, power_);
  }

  /// Returns true for header lines before the first event, and evaluates them.
  bool read_header_line(std::string_view line) {
    constexpr std::string_view geometry = "%geometry:";
    Fields fields;
    if (line.starts_with(geometry)) {
      if (split(line.substr(geometry.size()), false, fields) != 2) return true;
      const auto size = read_size(fields[0], fields[1]);
      if (size != SensorSize{}) stream_.size = size;
      has_geometry_ = true;
      return true;
    }
    if (is_comment(line)) {
      read_names_in_comment(line);
      return true;
    }
    const auto first = line.find_first_not_of("\"', ;\t");
    const bool are_names = first != std::string_view::npos && is_letter(line[first]);
    const auto count = split(line, are_names, fields);
    if (count == 2) {
      if (stream_.size != SensorSize{}) return false;
      stream_.size = read_size(fields[0], fields[1]);
      return stream_.size != SensorSize{};
    }
    if (has_names_ || !are_names) return false;

    unit_.reset();
    const auto names = std::span(fields).first(count);
    columns_ = columns_named(names);
    const auto txyp = *columns_of("txyp");
    is_named_txyp_ = names[0] == "t" && count >= event_columns &&
                     std::ranges::equal(std::span(columns_).first(event_columns), txyp);
    SensorSize size;
    for (std::size_t i = 0; i < count; ++i) {
      const auto at = names[i].find('@');
      if (at == std::string_view::npos) continue;
      if (columns_[i] == EventColumn::x)
        size.width = read_extent(names[i].substr(at + 1)).value_or(0);
      if (columns_[i] == EventColumn::y)
        size.height = read_extent(names[i].substr(at + 1)).value_or(0);
    }
    if (size.width > 0 && size.height > 0) stream_.size = size;
    if (!are_all_named() && settings_.columns.empty())
      throw UnsupportedFormat("no columns t, x, y and p in the first line");
    has_names_ = true;
    return true;
  }

  /// Returns the columns with these names, and sets the unit in the name of the time.
  Columns columns_named(std::span<const std::string_view> names) {
    Columns columns;
    for (const auto text : names) {
      const auto name = column_named(text);
      auto column = name ? std::optional(name->column) : std::nullopt;
      if (std::ranges::find(columns, column) != columns.end()) column.reset();
      columns.push_back(column);
      if (column == EventColumn::t) unit_ = name->unit;
    }
    return columns;
  }

  /// True if there are columns t, x, y and p.
  bool are_all_named() const {
    return std::ranges::count_if(columns_, [](auto column) {
             return column && *column <= EventColumn::p;
           }) >= static_cast<std::ptrdiff_t>(event_columns);
  }

  /// Reads the names of columns from a comment, such as "# t [s] x y p" or "# columns: x, y, p, t".
  void read_names_in_comment(std::string_view line) {
    const auto begin = line.find_first_not_of("#% \t");
    if (begin == std::string_view::npos || line.size() > max_line) return;
    line.remove_prefix(begin);
    if (const auto colon = line.rfind(':'); colon != std::string_view::npos)
      line.remove_prefix(colon + 1);
    Fields fields;
    const auto count = split(line, true, fields);
    std::vector<std::string> names;
    for (const auto field : std::span(fields).first(count)) {
      const bool is_unit = !field.empty() && (field.front() == '[' || field.front() == '(');
      if (is_unit && !names.empty())
        names.back() += " " + std::string(field);
      else
        names.emplace_back(field);
    }
    const std::vector<std::string_view> views(names.begin(), names.end());
    const auto before = std::exchange(columns_, columns_named(views));
    if (!are_all_named()) columns_ = before;
  }

  void find_columns(const TableSample& sample) {
    if (!settings_.columns.empty()) {
      columns_ = settings_.columns;
    } else if (!has_names_ && (columns_.empty() || !sample.has_events(columns_))) {
      unit_.reset();
      auto found = sample.find_columns(has_geometry_);
      if (!found)
        throw UnsupportedFormat(
            "not CSV events, or an unknown column order; set column-order, or name the columns t, "
            "x, "
            "y and p in the first line");
      columns_ = *std::move(found);
      return;
    } else if (has_names_ && sample.counts_rows(columns_.size() + 1)) {
      columns_.insert(columns_.begin(), std::nullopt);  // unnamed index column
    }
    if (!sample.empty() && !sample.has_events(columns_))
      throw UnsupportedFormat(
          "not CSV events: no line has numbers t, x, y and p in the expected columns; separate the "
          "fields by commas, semicolons or blanks, and write decimal points");
  }

  void find_unit(const TableSample& sample) {
    const bool is_either = !has_names_ && (separator_ == ' ' || separator_ == '\t');
    auto unit = settings_.unit ? settings_.unit : unit_;
    if (!unit) unit = sample.find_unit(columns_, is_either, is_named_txyp_);
    if (!unit)
      throw UnsupportedFormat(
          "the time unit is ambiguous in the first lines; set time-unit, or name the column t_s, "
          "t_us or t_ns in the first line");
    power_ = power_of(*unit);
  }

  void read_text(std::string_view text, Decoded& out) {
    if (skipping_ || !rest_.empty()) {
      const auto end = text.find('\n');
      const auto part = text.substr(0, end);
      if (!skipping_ && rest_.size() + part.size() > max_line) {
        corruption_.note(position_, "line too long");
        position_ += rest_.size();
        rest_.clear();
        skipping_ = true;
      }
      if (skipping_) {
        position_ += part.size();
      } else {
        rest_ += part;
      }
      if (end == std::string_view::npos) return;
      text.remove_prefix(end + 1);
      if (!skipping_) read_line(rest_, out);
      position_ += rest_.size() + 1;
      rest_.clear();
      skipping_ = false;
    }

    const auto last = text.rfind('\n');
    if (last != std::string_view::npos) {
      const auto* const begin = text.data();
      text.remove_prefix(
          static_cast<std::size_t>(read_lines(begin, begin + last + 1, out) - begin));
    }
    if (text.size() > max_line) {
      corruption_.note(position_, "line too long");
      position_ += text.size();
      skipping_ = true;
    } else {
      rest_ = text;
    }
  }

  /// Reads complete lines and returns `end`.
  const char* read_lines(const char* at, const char* end, Decoded& out) {
    while (at < end) {
      if (plain_lines_) {
        const char* const first = at;
        std::uint64_t lines = 0;
        while (end - at > PlainLines::reach) {
          PlainLines::Row row;
          const char* const next = plain_lines_->read(at, row);
          if (next == nullptr) break;
          ++lines;
          validator_.append(row.t, row.x, row.y, row.on, out.events, corruption_);
          at = next;
        }
        position_ += static_cast<std::uint64_t>(at - first);
        lines_ += lines;
        rows_.count(lines);
      }
      const auto* const line_end =
          static_cast<const char*>(std::memchr(at, '\n', static_cast<std::size_t>(end - at)));
      const std::string_view line(at, static_cast<std::size_t>(line_end - at));
      if (line.size() > max_line) {
        corruption_.note(position_, "line too long");
      } else {
        read_line(line, out);
      }
      position_ += line.size() + 1;
      at = line_end + 1;
    }
    return end;
  }

  void read_line(std::string_view line, Decoded& out) {
    ++lines_;
    line = trimmed(line);
    if (is_comment(line)) return;
    Fields fields;
    const auto count = split(line, false, fields);
    const auto row = read_row(std::span(fields).first(count));
    rows_.count(1);
    if (!row) {
      constexpr std::size_t max_shown = 60;
      corruption_.note(position_, "line without an event");
      rows_.add("line " + std::to_string(lines_) + ": \"" + std::string(line.substr(0, max_shown)) +
                "\" (fields: " + std::to_string(count) +
                ", expected: " + std::to_string(columns_.size()) + ")");
      return;
    }
    validator_.append(row->t.value, row->x, row->y, row->on,
                      label_from(row->cause, row->object_class), out.events, corruption_);
  }

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

}  // namespace

std::optional<Decimal> read_decimal(std::string_view text, int power) {
  auto number = parsed(text);
  if (!number) return std::nullopt;
  number->power += power;
  return rounded_down(*number);
}

std::unique_ptr<EventDecoder> make_csv_decoder(const TableSettings& settings) {
  return std::make_unique<CsvDecoder>(settings);
}

bool is_csv(std::span<const std::uint8_t> start) {
  constexpr std::size_t max_bytes = 4096;
  constexpr std::size_t min_events = 3;
  const auto is_text = [](char letter) {
    const auto byte = static_cast<std::uint8_t>(letter);
    return byte >= ' ' || (byte >= '\t' && byte <= '\r');
  };
  std::string converted;
  auto text = Utf8Text().text_of(start.first(std::min(start.size(), max_bytes)), converted);
  if (!std::ranges::all_of(text, is_text)) return false;
  text = text.substr(0, text.rfind('\n') + 1);
  CsvDecoder decoder({.unit = TimeUnit::microseconds});
  Decoded decoded;
  try {
    decoder.decode({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, decoded);
    decoder.finish(decoded);
  } catch (const UnsupportedFormat&) {
    return decoder.has_names();  // the reader reports the error
  }
  const auto events = decoded.events.size() + decoder.corruption().outside;
  return decoder.has_names() || (events >= min_events && decoder.corruption().places == 0);
}

}  // namespace eventcamera
