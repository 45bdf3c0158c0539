// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/text/csv_encoder.hpp"

#include <algorithm>
#include <charconv>
#include <deque>
#include <string>
#include <vector>

namespace eventcamera {

namespace {

using enum TimeUnit;
using Column = EventColumn;
using Header = CsvFormat::Header;

constexpr ColumnOrder txyp = {Column::t, Column::x, Column::y, Column::p};
constexpr ColumnOrder xypt = {Column::x, Column::y, Column::p, Column::t};
constexpr ColumnOrder xytp = {Column::x, Column::y, Column::t, Column::p};

constexpr NamedCsvFormat formats[] = {
    {"names",
     "t,x,y,p in microseconds below a line of names",
     {txyp, ',', microseconds, Header::names, false, false}},
    {"labels",
     "t,x,y,p,cause,class in microseconds below a line of names",
     {.order = txyp, .labels = true}},
    {"metavision",
     "x,y,p,t in microseconds below a line %geometry:W,H",
     {xypt, ',', microseconds, Header::geometry, false, false}},
    {"aestream", "t,x,y,p in microseconds", {txyp, ',', microseconds, Header::none, false, false}},
    {"faery",
     "t,x,y,p in microseconds below t,x@W,y@H,on",
     {txyp, ',', microseconds, Header::names_and_size, false, true}},
    {"rpg",
     "t x y p in seconds, the Event Camera Dataset's",
     {txyp, ' ', seconds, Header::none, false, false}},
    {"e2vid",
     "t x y p in seconds below a line W H",
     {txyp, ' ', seconds, Header::size, false, false}},
    {"v2e",
     "t x y p in seconds below comments",
     {txyp, ' ', seconds, Header::comment, false, false}},
    {"esim",
     "t x y p in nanoseconds, rpg_esim's benchmark",
     {txyp, ' ', nanoseconds, Header::none, false, false}},
    {"esim-py", "x,y,t,p in seconds, OFF is -1", {xytp, ',', seconds, Header::none, true, false}},
    {"dvs-voltmeter",
     "t x y p in microseconds",
     {txyp, ' ', microseconds, Header::none, false, false}},
};

/// Upper bound of the line length: a time of 19 digits, a sign and three zeros, and the other
/// fields.
constexpr std::size_t max_line = 64;
constexpr std::size_t batch_size = 1024;

template <class Number>
char* write_number(char* at, Number number) {
  return std::to_chars(at, at + max_line, number).ptr;
}

std::string header_text(const CsvFormat& format, SensorSize size) {
  const std::string end = format.carriage_return ? "\r\n" : "\n";
  const auto width = std::to_string(size.width);
  const auto height = std::to_string(size.height);
  const bool sized = format.header == Header::names_and_size;
  const std::string names_of[] = {"t", sized ? "x@" + width : "x", sized ? "y@" + height : "y",
                                  sized ? "on" : "p"};
  std::string names;
  for (const auto column : format.order) {
    if (!names.empty()) names += format.separator;
    names += names_of[static_cast<std::size_t>(column)];
  }
  if (format.labels)
    names += std::string(1, format.separator) + "cause" + format.separator + "class";
  switch (format.header) {
    case Header::none:
      return {};
    case Header::names:
    case Header::names_and_size:
      return names + end;
    case Header::geometry:
      return "%geometry:" + width + "," + height + end;
    case Header::size:
      return width + format.separator + height + end;
    case Header::comment:
      return "# " + names + end;
  }
  return {};
}

class CsvEncoder final : public Encoder {
 public:
  CsvEncoder(const CsvFormat& format, SensorSize size)
      : Encoder(header_text(format, size)), format_(format) {}

  std::size_t label(std::span<const Label> labels) override {
    if (!format_.labels) return 0;
    labels_.insert(labels_.end(), labels.begin(), labels.end());
    return labels.size();
  }

 private:
  void append(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out) override {
    char text[batch_size * max_line];
    while (!events.empty()) {
      const auto count = std::min(events.size(), batch_size);
      char* at = text;
      for (const auto& event : events.first(count)) at = write(at, event);
      out.insert(out.end(), text, at);
      events = events.subspan(count);
    }
  }

  char* write(char* at, Microseconds t) const {
    if (format_.unit == microseconds) return write_number(at, t);
    auto magnitude = static_cast<std::uint64_t>(t);
    if (t < 0) {
      *at++ = '-';
      magnitude = 0 - magnitude;
    }
    if (format_.unit == nanoseconds) {
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

  char* write(char* at, const AbsoluteEvent& event) {
    for (const auto column : format_.order) {
      switch (column) {
        case Column::t:
          at = write(at, event.t);
          break;
        case Column::x:
          at = write_number(at, event.x);
          break;
        case Column::y:
          at = write_number(at, event.y());
          break;
        case Column::p:
          if (event.polarity() == Polarity::on) {
            *at++ = '1';
          } else if (format_.minus_one) {
            *at++ = '-';
            *at++ = '1';
          } else {
            *at++ = '0';
          }
          break;
        case Column::cause:
        case Column::object_class:
          break;  // never in the order: they follow the others
      }
      *at++ = format_.separator;
    }
    if (format_.labels) {
      Label label;
      if (!labels_.empty()) {
        label = labels_.front();
        labels_.pop_front();
      }
      at = write_number(at, static_cast<unsigned>(label.cause));
      *at++ = format_.separator;
      at = write_number(at, label.object_class);
      *at++ = format_.separator;
    }
    --at;
    if (format_.carriage_return) *at++ = '\r';
    *at++ = '\n';
    return at;
  }

  CsvFormat format_;
  std::deque<Label> labels_;  ///< of the next events
};

}  // namespace

std::span<const NamedCsvFormat> csv_formats() {
  return formats;
}

std::unique_ptr<Encoder> make_csv_encoder(const CsvFormat& format, SensorSize size) {
  return std::make_unique<CsvEncoder>(format, size);
}

}  // namespace eventcamera
