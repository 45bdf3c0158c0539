// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/text/csv_encoder.hpp"

#include <algorithm>
#include <charconv>

namespace eventcamera {

namespace {

/// More than the longest line: a time of 19 digits, a sign and three noughts, and the rest.
constexpr std::size_t max_line = 64;
constexpr std::size_t events_at_once = 1024;

template <class Number>
char* write_number(char* at, Number number) {
  return std::to_chars(at, at + max_line, number).ptr;
}

}  // namespace

std::string CsvEncoder::header() const {
  const std::string end = dialect_.carriage_return ? "\r\n" : "\n";
  const auto width = std::to_string(size_.width);
  const auto height = std::to_string(size_.height);
  std::string names;
  for (const auto column : dialect_.order) {
    const bool sized = dialect_.header == CsvDialect::Header::names_and_size;
    if (!names.empty()) names += dialect_.separator;
    switch (column) {
      case EventColumn::t:
        names += "t";
        break;
      case EventColumn::x:
        names += sized ? "x@" + width : "x";
        break;
      case EventColumn::y:
        names += sized ? "y@" + height : "y";
        break;
      case EventColumn::p:
        names += sized ? "on" : "p";
        break;
    }
  }
  switch (dialect_.header) {
    case CsvDialect::Header::none:
      return {};
    case CsvDialect::Header::names:
    case CsvDialect::Header::names_and_size:
      return names + end;
    case CsvDialect::Header::geometry:
      return "%geometry:" + width + "," + height + end;
    case CsvDialect::Header::size:
      return width + dialect_.separator + height + end;
    case CsvDialect::Header::comment:
      return "# " + names + end;
  }
  return {};
}

void CsvEncoder::begin(std::vector<std::uint8_t>& out) {
  if (begun_) return;
  begun_ = true;
  const auto text = header();
  out.insert(out.end(), text.begin(), text.end());
}

char* CsvEncoder::write(char* at, Microseconds t) const {
  if (dialect_.unit == TimeUnit::microseconds) return write_number(at, t);
  auto magnitude = static_cast<std::uint64_t>(t);
  if (t < 0) {
    *at++ = '-';
    magnitude = 0 - magnitude;
  }
  if (dialect_.unit == TimeUnit::nanoseconds) {
    at = write_number(at, magnitude);
    if (magnitude == 0) return at;
    return std::fill_n(at, 3, '0');
  }
  at = write_number(at, magnitude / 1'000'000);
  *at++ = '.';
  auto fraction = static_cast<std::uint32_t>(magnitude % 1'000'000);
  for (int digit = 5; digit >= 0; --digit, fraction /= 10)
    at[digit] = static_cast<char>('0' + fraction % 10);
  return at + 6;
}

char* CsvEncoder::write(char* at, const AbsoluteEvent& event) const {
  for (const auto column : dialect_.order) {
    switch (column) {
      case EventColumn::t:
        at = write(at, event.t);
        break;
      case EventColumn::x:
        at = write_number(at, event.x);
        break;
      case EventColumn::y:
        at = write_number(at, event.y());
        break;
      case EventColumn::p:
        if (event.polarity() == Polarity::on) {
          *at++ = '1';
        } else if (dialect_.minus_one) {
          *at++ = '-';
          *at++ = '1';
        } else {
          *at++ = '0';
        }
        break;
    }
    *at++ = dialect_.separator;
  }
  --at;
  if (dialect_.carriage_return) *at++ = '\r';
  *at++ = '\n';
  return at;
}

void CsvEncoder::encode(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) {
  begin(out);
  char text[events_at_once * max_line];
  while (!events.empty()) {
    const auto count = std::min(events.size(), events_at_once);
    char* at = text;
    for (const auto& event : events.first(count)) at = write(at, event);
    out.insert(out.end(), text, at);
    events = events.subspan(count);
  }
}

void CsvEncoder::finish(std::vector<std::uint8_t>& out) {
  begin(out);
}

}  // namespace eventcamera
