// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/numpy/npy_decoder.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "src/core/byte_order.hpp"

namespace eventcamera {

namespace {

constexpr const char* save_rows = "save numpy.ascontiguousarray(events) of the shape (N, 4)";

double half_of(std::uint16_t bits) {
  const int exponent = bits >> 10 & 31;
  const int mantissa = bits & 1023;
  const double magnitude = exponent == 0    ? std::ldexp(mantissa, -24)
                           : exponent == 31 ? std::numeric_limits<double>::infinity()
                                            : std::ldexp(mantissa + 1024, exponent - 25);
  return (bits & 0x8000) != 0 ? -magnitude : magnitude;
}

std::uint64_t word_of(const NpyField& field, const std::uint8_t* element) {
  std::uint64_t word = 0;
  std::memcpy(&word, element + field.offset, field.bytes);
  return field.big_endian ? __builtin_bswap64(word) >> (64 - 8 * field.bytes) : word;
}

double floating_of(const NpyField& field, const std::uint8_t* element) {
  const auto word = word_of(field, element);
  if (field.bytes == 8) return std::bit_cast<double>(word);
  if (field.bytes == 4) return std::bit_cast<float>(static_cast<std::uint32_t>(word));
  return half_of(static_cast<std::uint16_t>(word));
}

/// Multiplies an integer by a power of ten and rounds down; nothing if the result exceeds 64 bits.
std::optional<std::int64_t> scaled(std::int64_t number, int power) {
  for (; power > 0; --power)
    if (__builtin_mul_overflow(number, 10, &number)) return std::nullopt;
  std::int64_t divisor = 1;
  for (; power < 0; ++power) divisor *= 10;
  return number / divisor - (number % divisor < 0 ? 1 : 0);
}

/// Multiplies the number in a field by a power of ten and rounds down, or up by at most
/// `max_rounding_up` if it has a fraction; nothing if the result exceeds 64 bits.
std::optional<std::int64_t> number_of(const NpyField& field, const std::uint8_t* element,
                                      int power = 0) {
  const unsigned unused = 64 - 8 * field.bytes;
  switch (field.kind) {
    case NpyField::Kind::signed_integer:
      return scaled(static_cast<std::int64_t>(word_of(field, element) << unused) >> unused, power);
    case NpyField::Kind::unsigned_integer:
    case NpyField::Kind::boolean: {
      const auto word = word_of(field, element);
      if (~word == 0) return -1;  // a signed number that was stored as an unsigned one
      if (word > std::numeric_limits<std::int64_t>::max()) return std::nullopt;
      return scaled(static_cast<std::int64_t>(word), power);
    }
    case NpyField::Kind::floating:
      break;
  }
  constexpr double factors[] = {1e-3, 1, 1e3, 1e6};
  const double factor = factors[power / 3 + 1];
  const double number = std::floor(floating_of(field, element) * factor + max_rounding_up);
  if (!(std::abs(number) < 0x1p63)) return std::nullopt;  // also rejects NaN
  return static_cast<std::int64_t>(number);
}

TableNumber sample_of(const NpyField& field, const std::uint8_t* element) {
  if (field.kind == NpyField::Kind::floating)
    return {floating_of(field, element), TableNumber::Form::floating};
  const auto number = number_of(field, element);
  return {number ? static_cast<double>(*number) : std::numeric_limits<double>::quiet_NaN()};
}

/// Reads a little-endian integer from 8 bytes within the element.
struct Window {
  explicit Window(const NpyField& field, std::uint32_t element_bytes)
      : at(std::min(field.offset, element_bytes - 8)),
        left(64 - 8 * (field.offset - at + field.bytes)),
        right(64 - 8 * field.bytes),
        is_signed(field.kind == NpyField::Kind::signed_integer) {}

  std::int64_t read(const std::uint8_t* element) const {
    const auto word = little_endian<std::uint64_t>(element + at) << left;
    return is_signed ? static_cast<std::int64_t>(word) >> right
                     : static_cast<std::int64_t>(word >> right);
  }

  std::uint32_t at;
  unsigned left, right;
  bool is_signed;
};

class NpyDecoder final : public EventDecoder {
 public:
  explicit NpyDecoder(const TableSettings& settings) : settings_(settings) {
    stream_.size = settings.size;
    validator_.set_size(stream_.size);
  }

  NpyDecoder(const NpyHeader& header, const TableSettings& settings) : NpyDecoder(settings) {
    begin(header);
  }

  void decode(std::span<const std::uint8_t> bytes, Decoded& out) override {
    if (bytes.empty()) return;
    if (!header_) {
      auto header = preamble_.read(bytes);
      if (!header) return;
      begin(*std::move(header));
    }
    if (!header_->by_columns) {
      decode_rows(bytes, out);
      return;
    }
    constexpr std::size_t max_collected = std::size_t{1} << 30;
    if (bytes.size() > max_collected - columns_.size())
      throw UnsupportedFormat(
          std::string("the NumPy array is too large for its order of numbers; ") + save_rows);
    columns_.insert(columns_.end(), bytes.begin(), bytes.end());
  }

  void finish(Decoded& out) override {
    if (!header_) throw UnsupportedFormat("truncated NumPy header");
    if (header_->by_columns) decode_columns(out);
    if (!layout_known_) read_sample(out);
    rows_.check(true);
    if (!rest_.empty()) {
      corruption_.note(position_, "truncated last event");
    } else if (left_ > 0 && header_->count != npy_unknown_count) {
      corruption_.note(position_, "fewer events than the NumPy header says");
    }
  }

  bool is_table() const override { return true; }

  void decode_tail(ByteSource& source, Decoded& out) const override {
    if (!layout_known_ || header_->by_columns) return;
    const std::uint64_t size = header_->element_bytes;
    const std::uint64_t begin = preamble_.size();
    if (source.size() < begin + size) return;
    const auto count = std::min(header_->count, (source.size() - begin) / size);
    const auto last = std::min(count, std::max<std::uint64_t>(tail_size / size, 1));
    std::vector<std::uint8_t> bytes(last * size);
    if (source.read(begin + (count - last) * size, bytes) != bytes.size()) return;
    NpyDecoder tail(*header_, settings_);
    tail.layout_known_ = true;
    tail.power_ = power_;
    tail.plain_ = plain_;
    tail.polarities_ = polarities_;
    tail.stream_.labelled = stream_.labelled;
    tail.left_ = last;
    tail.decode(bytes, out);
  }

 private:
  /// Throws UnsupportedFormat if the rows of an array of plain numbers cannot be events.
  void check_columns(std::size_t count) const {
    const auto what =
        "the NumPy array has " + std::to_string(count) + (count == 1 ? " column; " : " columns; ");
    if (count < event_columns) throw UnsupportedFormat(what + "an event needs four: t, x, y and p");
    if (!settings_.columns.empty() && count != settings_.columns.size())
      throw UnsupportedFormat(what + "column-order has " +
                              std::to_string(settings_.columns.size()));
  }

  /// Reads elements, in pieces of any size.
  void decode_rows(std::span<const std::uint8_t> bytes, Decoded& out) {
    // Completes the first bytes; false if more are needed.
    const auto collect = [&](std::size_t wanted) {
      const auto count = std::min(wanted - rest_.size(), bytes.size());
      rest_.insert(rest_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
      bytes = bytes.subspan(count);
      return rest_.size() == wanted;
    };
    if (!layout_known_) {
      if (!collect(sample_bytes_)) return;
      read_sample(out);
    }
    const std::size_t size = header_->element_bytes;
    if (!rest_.empty()) {
      if (!collect(size)) return;
      read_elements(rest_.data(), 1, out);
      rest_.clear();
    }
    const auto count = std::min<std::uint64_t>(bytes.size() / size, left_);
    read_elements(bytes.data(), count, out);
    rows_.check(false);
    bytes = bytes.subspan(count * size);
    if (left_ > 0) {
      rest_.assign(bytes.begin(), bytes.end());
    } else if (!bytes.empty() && !after_end_) {
      corruption_.note(position_, "bytes after the last event of the NumPy array");
      after_end_ = true;
    }
  }

  /// Reads the collected array in blocks of rows.
  void decode_columns(Decoded& out) {
    constexpr std::size_t max_rows = std::size_t{1} << 14;
    const auto count = header_->columns.size();
    const std::size_t number_bytes = header_->element_bytes / count;
    if (columns_.size() / header_->element_bytes < header_->count)
      throw UnsupportedFormat(
          std::string(
              "the NumPy array is cut short, and its numbers are not in the order of events; ") +
          save_rows);
    const auto rows = static_cast<std::size_t>(header_->count);
    std::vector<std::uint8_t> block;
    for (std::size_t row = 0; row < rows; row += max_rows) {
      const auto part = std::min(rows - row, max_rows);
      block.resize(part * header_->element_bytes);
      for (std::size_t i = 0; i < count; ++i)
        for (std::size_t j = 0; j < part; ++j)
          std::memcpy(block.data() + (j * count + i) * number_bytes,
                      columns_.data() + (i * rows + row + j) * number_bytes, number_bytes);
      decode_rows(block, out);
    }
  }

  void begin(NpyHeader header) {
    if (!header.columns.empty()) check_columns(header.columns.size());
    constexpr std::uint64_t max_sample = std::uint64_t{1} << 20;
    left_ = header.count;
    position_ = preamble_.size();
    const auto rows =
        std::clamp<std::uint64_t>(max_sample / header.element_bytes, 1, TableSample::max_rows);
    sample_bytes_ = static_cast<std::size_t>(std::min(rows, left_) * header.element_bytes);
    header_ = std::move(header);
  }

  /// Detects the layout from the first elements, then reads them.
  void read_sample(Decoded& out) {
    const auto elements = std::exchange(rest_, {});
    const auto whole = elements.size() / header_->element_bytes;
    const auto end = whole * header_->element_bytes;
    find_layout(std::span(elements).first(end));
    read_elements(elements.data(), whole, out);
    rows_.check(true);
    rest_.assign(elements.begin() + static_cast<std::ptrdiff_t>(end), elements.end());
  }

  void find_layout(std::span<const std::uint8_t> elements) {
    const bool has_names = header_->columns.empty();
    const auto fields = has_names ? std::span<const NpyField>(header_->fields).first(event_columns)
                                  : header_->columns;
    TableSample sample;
    for (; !elements.empty(); elements = elements.subspan(header_->element_bytes)) {
      TableSample::Row row;
      for (const auto& field : fields) row.push_back(sample_of(field, elements.data()));
      sample.add(std::move(row));
    }
    auto columns = has_names ? columns_of("txyp") : std::optional(settings_.columns);
    if (columns->empty()) columns = sample.find_columns();
    if (!columns || columns->size() != fields.size())
      throw UnsupportedFormat("unknown columns in the NumPy array; set column-order for all " +
                              std::to_string(fields.size()) +
                              " of them, or save a structured array of x, y, t and p");
    if (!has_names)
      for (std::size_t i = 0; i < columns->size(); ++i)
        if (const auto column = (*columns)[i])
          header_->fields[static_cast<std::size_t>(*column)] = header_->columns[i];

    auto unit = settings_.unit ? settings_.unit : header_->unit;
    const auto is_written_as = [&](EventColumn column, NpyField::Kind kind, std::uint32_t bytes) {
      const auto& field = header_->fields[static_cast<std::size_t>(column)];
      return field.kind == kind && field.bytes == bytes;
    };
    using enum NpyField::Kind;
    const bool may_be_own = has_names && is_written_as(EventColumn::t, signed_integer, 8) &&
                            is_written_as(EventColumn::x, unsigned_integer, 2) &&
                            is_written_as(EventColumn::y, unsigned_integer, 2) &&
                            is_written_as(EventColumn::p, unsigned_integer, 1);
    if (!unit) unit = sample.find_unit(*columns, false, may_be_own);
    if (!unit)
      throw UnsupportedFormat(
          "the time unit of the NumPy array is ambiguous; set time-unit, or name the times t_s, "
          "t_us "
          "or t_ns");
    if (!sample.empty()) polarities_ = sample.find_polarities(*columns);
    power_ = power_of(*unit);
    const std::span<const NpyField> all(header_->fields);
    stream_.labelled = std::ranges::any_of(all.subspan(event_columns),
                                           [](const NpyField& field) { return field.bytes > 0; });
    plain_ = power_ == 0 && !polarities_.is_one_two() &&
             header_->element_bytes >= sizeof(std::uint64_t) && !stream_.labelled &&
             std::ranges::all_of(all.first(event_columns), [](const NpyField& field) {
               // Unsigned 64-bit numbers may not fit.
               return field.kind != NpyField::Kind::floating &&
                      (!field.big_endian || field.bytes == 1) &&
                      (field.kind == NpyField::Kind::signed_integer || field.bytes < 8);
             });
    layout_known_ = true;
  }

  /// Records that the row before the last `rows_to_read` rows is not an event.
  void note_unreadable(std::uint64_t rows_to_read) {
    corruption_.note(position_, "number out of range");
    rows_.add("row " + std::to_string(rows_.rows() - rows_to_read) +
              ": a time or a coordinate out of range, or a polarity other than 0, 1 and -1");
  }

  void read_elements(const std::uint8_t* bytes, std::uint64_t count, Decoded& out) {
    const auto size = header_->element_bytes;
    const auto* const end = bytes + count * size;
    left_ -= count;
    rows_.count(count);
    const auto field = [&](EventColumn column) -> const NpyField& {
      return header_->fields[static_cast<std::size_t>(column)];
    };
    const auto& t_field = field(EventColumn::t);
    const auto& x_field = field(EventColumn::x);
    const auto& y_field = field(EventColumn::y);
    const auto& p_field = field(EventColumn::p);
    if (plain_) {
      const Window t(t_field, size), x(x_field, size), y(y_field, size), p(p_field, size);
      for (; bytes < end; bytes += size, position_ += size) {
        if (const auto on = polarities_.is_on(p.read(bytes)); on)
          validator_.append(t.read(bytes), x.read(bytes), y.read(bytes), *on, out.events,
                            corruption_);
        else
          note_unreadable(static_cast<std::uint64_t>(end - bytes) / size);
      }
      return;
    }
    const auto label_number = [&](EventColumn column) {
      return field(column).bytes > 0 ? number_of(field(column), bytes).value_or(0) : 0;
    };
    for (; bytes < end; bytes += size, position_ += size) {
      const auto t = number_of(t_field, bytes, power_);
      const auto x = number_of(x_field, bytes);
      const auto y = number_of(y_field, bytes);
      const auto p = number_of(p_field, bytes);
      const auto on = p ? polarities_.is_on(*p) : std::nullopt;
      if (t && x && y && on) {
        const auto label =
            label_from(label_number(EventColumn::cause), label_number(EventColumn::object_class));
        validator_.append(*t, *x, *y, *on, label, out.events, corruption_);
      } else {
        note_unreadable(static_cast<std::uint64_t>(end - bytes) / size);
      }
    }
  }

  TableSettings settings_;
  NpyPreamble preamble_;
  std::optional<NpyHeader> header_;
  std::size_t sample_bytes_ = 0;  ///< size of the first elements, to detect the layout
  bool layout_known_ = false;
  int power_ = 0;       ///< power of ten from the time unit to microseconds
  bool plain_ = false;  ///< all fields are little-endian integers, in elements of 8 bytes or more
  std::vector<std::uint8_t> rest_;  ///< first elements, or start of an element
  std::uint64_t position_ = 0;      ///< offset of the next byte to read
  std::uint64_t left_ = 0;          ///< remaining elements according to the header
  bool after_end_ = false;
  std::vector<std::uint8_t> columns_;  ///< an array by columns, which is collected as a whole
  PolarityCode polarities_;
  RowValidator validator_;
  UnreadableRows rows_;
};

}  // namespace

std::unique_ptr<EventDecoder> make_npy_decoder(const TableSettings& settings) {
  return std::make_unique<NpyDecoder>(settings);
}

std::unique_ptr<EventDecoder> make_npy_decoder(const NpyHeader& header,
                                               const TableSettings& settings) {
  return std::make_unique<NpyDecoder>(header, settings);
}

std::optional<std::int64_t> npy_integer(const NpyField& field, const std::uint8_t* element) {
  return number_of(field, element);
}

}  // namespace eventcamera
