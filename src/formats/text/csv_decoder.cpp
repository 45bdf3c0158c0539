// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/text/csv_decoder.hpp"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <limits>

#include "src/core/max_side.hpp"
#include "src/formats/text/decimal.hpp"

namespace eventcamera {

namespace {

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

std::optional<bool> read_polarity(std::string_view text) {
  if (text == "1") return true;
  if (text == "0") return false;
  if (is_word(text, "true")) return true;
  if (is_word(text, "false")) return false;
  const auto number = read_decimal(text, 0);
  if (!number || !number->whole || number->value < -1 || number->value > 1) return std::nullopt;
  return number->value == 1;
}

/// Removes quotes.
std::string_view unquoted(std::string_view field) {
  if (field.size() < 2 || field.front() != '"' || field.back() != '"') return field;
  return field.substr(1, field.size() - 2);
}

bool is_letter(char letter) {
  letter = static_cast<char>(letter | 0x20);
  return letter >= 'a' && letter <= 'z';
}

TableNumber sample_of(std::string_view field) {
  if (is_word(field, "true")) return {1};
  if (is_word(field, "false")) return {0};
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

}  // namespace

CsvDecoder::CsvDecoder(const TableSettings& settings) : settings_(settings) {}

void CsvDecoder::decode(std::span<const std::uint8_t> bytes, Decoded& out) {
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (in_head_) {
    const auto count = take_head(text);
    if (head_lines_ < head_lines && head_.size() < max_head) return;
    text.remove_prefix(count);
    read_head();
    const auto head = std::move(head_);
    read_text(std::string_view(head).substr(static_cast<std::size_t>(position_)), out);
  }
  read_text(text, out);
}

void CsvDecoder::finish(Decoded& out) {
  if (in_head_) {
    head_ += '\n';
    read_head();
    head_.pop_back();
    position_ = std::min<std::uint64_t>(position_, head_.size());
    const auto head = std::move(head_);
    read_text(std::string_view(head).substr(static_cast<std::size_t>(position_)), out);
  }
  if (!rest_.empty()) read_line(rest_, out);
  position_ += rest_.size();
  rest_.clear();
}

/// Appends `text` to the head, up to the head's end, and returns the number of characters appended.
std::size_t CsvDecoder::take_head(std::string_view text) {
  std::size_t count = 0;
  while (count < text.size() && head_lines_ < head_lines && head_.size() < max_head) {
    const char letter = text[count++];
    head_ += letter;
    if (line_begins_ && letter != '#' && letter != '%' && letter != '\n') ++head_lines_;
    line_begins_ = letter == '\n';
  }
  return count;
}

std::size_t CsvDecoder::split(std::string_view line, Fields& fields) {
  std::size_t count = 0;
  const bool by_marks = line.find_first_of(",;") != std::string_view::npos;
  line = trimmed(line);
  while (true) {
    if (count == fields.size()) return 0;
    const auto end = line.find_first_of(by_marks ? ",;" : " \t");
    fields[count++] = trimmed(line.substr(0, end));
    if (end == std::string_view::npos) return count;
    line.remove_prefix(end + 1);
    if (!by_marks) line = trimmed(line);
  }
}

/// Interprets the lines of the head and finds the start of the events.
void CsvDecoder::read_head() {
  in_head_ = false;
  TableSample sample;
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
    const bool header = sample.empty() && read_header_line(line);
    if (header) position_ = head_.size() - text.size();
    if (header || is_comment(line)) continue;
    if (sample.empty()) {
      const auto mark = line.find_first_of(",; \t");
      if (mark != std::string_view::npos) separator_ = line[mark];
    }
    Fields fields;
    const auto count = split(line, fields);
    TableSample::Row row(count);
    std::transform(fields.begin(), fields.begin() + static_cast<std::ptrdiff_t>(count), row.begin(),
                   sample_of);
    sample.add(std::move(row));
  }
  if (!empty && text.size() == head_.size())
    throw UnsupportedFormat("not CSV events: no line ends");

  if (settings_.size != SensorSize{}) stream_.size = settings_.size;
  validator_.set_size(stream_.size);
  find_columns(sample);
  find_unit(sample);
  stream_.labelled =
      std::ranges::any_of(columns_, [](auto column) { return column && *column > EventColumn::p; });
  if (columns_.size() == event_columns && !stream_.labelled)
    plain_lines_.emplace(columns_, separator_, power_);
}

/// Returns true for header lines before the first event, and evaluates them.
bool CsvDecoder::read_header_line(std::string_view line) {
  constexpr std::string_view geometry = "%geometry:";
  Fields fields;
  if (line.starts_with(geometry)) {
    if (split(line.substr(geometry.size()), fields) != 2) return true;
    const auto size = read_size(fields[0], fields[1]);
    if (size != SensorSize{}) stream_.size = size;
    has_geometry_ = true;
    return true;
  }
  if (is_comment(line)) return true;
  const auto count = split(line, fields);
  if (count == 2) {
    if (stream_.size != SensorSize{}) return false;
    stream_.size = read_size(fields[0], fields[1]);
    return stream_.size != SensorSize{};
  }
  const auto names = std::span(fields).first(count);
  // An index column may be unnamed.
  const auto named =
      std::ranges::find_if(names, [](std::string_view name) { return !unquoted(name).empty(); });
  if (has_names_ || named == names.end() || !is_letter(unquoted(*named).front())) return false;

  has_names_ = true;
  SensorSize size;
  for (const auto field : names) {
    const auto name = column_named(unquoted(field));
    auto column = name ? std::optional(name->column) : std::nullopt;
    if (std::ranges::find(columns_, column) != columns_.end()) column.reset();
    columns_.push_back(column);
    if (column == EventColumn::t) unit_ = name->unit;
    if (const auto at = field.find('@'); at != std::string_view::npos) {
      if (column == EventColumn::x) size.width = read_extent(field.substr(at + 1)).value_or(0);
      if (column == EventColumn::y) size.height = read_extent(field.substr(at + 1)).value_or(0);
    }
  }
  if (size.width > 0 && size.height > 0) stream_.size = size;
  const auto known = std::ranges::count_if(
      columns_, [](auto column) { return column && *column <= EventColumn::p; });
  if (known < static_cast<std::ptrdiff_t>(event_columns) && settings_.columns.empty())
    throw UnsupportedFormat("no columns t, x, y and p in the first line");
  return true;
}

std::optional<CsvDecoder::Row> CsvDecoder::read_row(
    std::span<const std::string_view> fields, std::span<const std::optional<EventColumn>> columns,
    int power) {
  if (fields.size() != columns.size()) return std::nullopt;
  Row row;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (!columns[i]) continue;
    if (*columns[i] == EventColumn::p) {
      const auto on = read_polarity(fields[i]);
      if (!on) return std::nullopt;
      row.on = *on;
      continue;
    }
    const auto number = read_decimal(fields[i], *columns[i] == EventColumn::t ? power : 0);
    if (*columns[i] > EventColumn::p) {  // a label, which may be missing
      auto& label = *columns[i] == EventColumn::cause ? row.cause : row.object_class;
      label = number && number->whole ? number->value : 0;
      continue;
    }
    if (!number) return std::nullopt;
    if (*columns[i] == EventColumn::t) {
      row.t = *number;
      continue;
    }
    if (!number->whole) return std::nullopt;
    (*columns[i] == EventColumn::x ? row.x : row.y) = number->value;
  }
  return row;
}

void CsvDecoder::find_columns(const TableSample& sample) {
  if (!settings_.columns.empty()) {
    columns_ = settings_.columns;
  } else if (!has_names_) {
    auto found = sample.find_columns(has_geometry_);
    if (!found)
      throw UnsupportedFormat(
          "not CSV events, or an unknown column order; set column-order, or name the columns t, x, "
          "y and p in the first line");
    columns_ = *std::move(found);
    return;
  } else if (sample.has_columns(columns_.size() + 1)) {
    columns_.insert(columns_.begin(), std::nullopt);  // unnamed index column
  }
  if (!sample.empty() && !sample.has_events(columns_))
    throw UnsupportedFormat("not CSV events: no line has the expected columns");
}

void CsvDecoder::find_unit(const TableSample& sample) {
  const bool is_either = !has_names_ && (separator_ == ' ' || separator_ == '\t');
  auto unit = settings_.unit ? settings_.unit : unit_;
  if (!unit) unit = sample.find_unit(columns_, is_either);
  if (!unit)
    throw UnsupportedFormat(
        "the time unit is ambiguous in the first lines; set time-unit, or name the column t_s, "
        "t_us "
        "or t_ns in the first line");
  power_ = power_of(*unit);
}

void CsvDecoder::read_text(std::string_view text, Decoded& out) {
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
    text.remove_prefix(static_cast<std::size_t>(read_lines(begin, begin + last + 1, out) - begin));
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
const char* CsvDecoder::read_lines(const char* at, const char* end, Decoded& out) {
  while (at < end) {
    if (plain_lines_) {
      const char* const first = at;
      while (end - at > PlainLines::reach) {
        PlainLines::Row row;
        const char* const next = plain_lines_->read(at, row);
        if (next == nullptr) break;
        validator_.take(row.t, row.x, row.y, row.on, out.events, corruption_);
        at = next;
      }
      position_ += static_cast<std::uint64_t>(at - first);
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

void CsvDecoder::read_line(std::string_view line, Decoded& out) {
  line = trimmed(line);
  if (is_comment(line)) return;
  Fields fields;
  const auto count = split(line, fields);
  const auto row = read_row(std::span(fields).first(count), columns_, power_);
  if (!row) {
    corruption_.note(position_, "line without an event");
    return;
  }
  validator_.take(row->t.value, row->x, row->y, row->on, label_from(row->cause, row->object_class),
                  out.events, corruption_);
}

}  // namespace eventcamera
