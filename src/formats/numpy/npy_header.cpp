// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/numpy/npy_header.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>

#include "src/core/byte_order.hpp"
#include "src/formats/corruption.hpp"

namespace eventcamera {

namespace {

constexpr std::uint32_t max_element_bytes = 65536;

/// Parses Python literals of the kinds that NumPy writes into headers.
class Literal {
 public:
  explicit Literal(std::string_view text) : rest_(text) {}

  /// Consumes `mark` if it is next.
  bool accept(char mark) {
    skip_blanks();
    if (!rest_.starts_with(mark)) return false;
    rest_.remove_prefix(1);
    return true;
  }

  void expect(char mark) {
    if (!accept(mark)) fail();
  }

  /// Calls element(), which must parse one, for each element of a list up to its `end`.
  template <class Element>
  void elements(char end, const Element& element) {
    while (!accept(end)) {
      element();
      if (accept(',')) continue;
      expect(end);
      return;
    }
  }

  /// Parses a quoted string. Escapes are not needed for the expected strings.
  std::string_view string() {
    skip_blanks();
    if (rest_.empty() || (rest_.front() != '\'' && rest_.front() != '"')) fail();
    const auto end = rest_.find(rest_.front(), 1);
    if (end == std::string_view::npos) fail();
    const auto text = rest_.substr(1, end - 1);
    rest_.remove_prefix(end + 1);
    return text;
  }

  bool starts_with_string() {
    skip_blanks();
    return rest_.starts_with('\'') || rest_.starts_with('"');
  }

  bool boolean() {
    skip_blanks();
    for (const std::string_view word : {"True", "False"}) {
      if (!rest_.starts_with(word)) continue;
      rest_.remove_prefix(word.size());
      return word == "True";
    }
    fail();
  }

  std::uint64_t integer() {
    skip_blanks();
    std::uint64_t value = 0;
    std::size_t digits = 0;
    for (; digits < rest_.size() && rest_[digits] >= '0' && rest_[digits] <= '9'; ++digits) {
      if (digits == 19) fail();
      value = value * 10 + static_cast<std::uint64_t>(rest_[digits] - '0');
    }
    if (digits == 0) fail();
    rest_.remove_prefix(digits);
    if (rest_.starts_with('L')) rest_.remove_prefix(1);  // written by Python 2
    return value;
  }

  void expect_end() {
    skip_blanks();
    if (!rest_.empty()) fail();
  }

  [[noreturn]] static void fail() { throw UnsupportedFormat("not a NumPy array"); }

 private:
  void skip_blanks() {
    while (!rest_.empty() && (rest_.front() == ' ' || rest_.front() == '\n' ||
                              rest_.front() == '\t' || rest_.front() == '\r'))
      rest_.remove_prefix(1);
  }

  std::string_view rest_;
};

/// Type such as <u2: byte order, kind and size in bytes.
struct Type {
  char order, kind;
  std::uint32_t bytes;
};

Type read_type(std::string_view text) {
  if (text.ends_with('O'))
    throw UnsupportedFormat(
        "the NumPy file holds pickled Python objects, which are not read; save arrays of numbers, "
        "as numpy.savez(file, t=t, x=x, y=y, p=p) does");
  if (text.size() < 3) Literal::fail();
  Literal size(text.substr(2));
  const auto number = size.integer();
  if (number > max_element_bytes) throw UnsupportedFormat("NumPy array elements too large");
  // Characters of U strings have four bytes.
  return {text[0], text[1], static_cast<std::uint32_t>(number) * (text[1] == 'U' ? 4 : 1)};
}

std::optional<NpyField> number_of(const Type& type, std::uint32_t offset) {
  constexpr std::string_view orders = "<>|=";
  constexpr std::string_view kinds = "iufb";  // in the order of NpyField::Kind
  const auto kind = static_cast<NpyField::Kind>(kinds.find(type.kind));
  const bool is_known = orders.find(type.order) != orders.npos &&
                        kinds.find(type.kind) != kinds.npos && std::has_single_bit(type.bytes) &&
                        type.bytes <= (kind == NpyField::Kind::boolean ? 1U : 8U) &&
                        type.bytes >= (kind == NpyField::Kind::floating ? 2U : 1U);
  if (!is_known) return std::nullopt;
  return NpyField{kind, type.order == '>', type.bytes, offset};
}

/// Parses the name of a field, which a title may precede: 'x' or ('title', 'x').
std::string_view read_name(Literal& literal) {
  if (!literal.accept('(')) return literal.string();
  literal.string();
  literal.expect(',');
  const auto name = literal.string();
  literal.expect(')');
  return name;
}

/// Parses the rest of a shape: 3,) or 3, 4). Returns the product of its extents and `bytes`.
std::uint64_t read_bytes(Literal& literal, std::uint64_t bytes) {
  literal.elements(')', [&] {
    const auto extent = literal.integer();
    if (extent > max_element_bytes || (bytes *= extent) > max_element_bytes)
      throw UnsupportedFormat("NumPy array elements too large");
  });
  return bytes;
}

/// Parses fields: [('x', '<u2'), ('y', '<u2', (3,)), ('', '|V4'), (('title', 'p'), '|u1')].
void read_fields(Literal& literal, NpyHeader& header) {
  std::array<bool, all_columns> known{};
  literal.expect('[');
  literal.elements(']', [&] {
    literal.expect('(');
    const auto name = read_name(literal);
    literal.expect(',');
    if (!literal.starts_with_string())
      throw UnsupportedFormat("unsupported NumPy fields with fields of their own");
    const auto type = read_type(literal.string());
    std::uint64_t bytes = type.bytes;
    bool one = true;
    if (literal.accept(',') && literal.accept('(')) {
      one = false;
      bytes = read_bytes(literal, bytes);
      literal.accept(',');
    }
    literal.expect(')');

    if (const auto column = column_named(name)) {
      const auto index = static_cast<std::size_t>(column->column);
      const auto number = one ? number_of(type, header.element_bytes) : std::nullopt;
      const bool is_label = column->column > EventColumn::p;
      if ((!number || known[index]) && !is_label)
        throw UnsupportedFormat("NumPy field '" + std::string(name) +
                                "' is not a number of 8 to 64 bits");
      if (number) header.fields[index] = *number;
      if (column->column == EventColumn::t) header.unit = column->unit;
      known[index] = true;
    }
    if (header.element_bytes + bytes > max_element_bytes)
      throw UnsupportedFormat("NumPy array elements too large");
    header.element_bytes += static_cast<std::uint32_t>(bytes);
  });
  for (const bool is_known : std::span(known).first(event_columns))
    if (!is_known) throw UnsupportedFormat("no fields t, x, y and p in the NumPy array");
}

/// Parses a shape: (3,) or (3, 4).
std::vector<std::uint64_t> read_shape(Literal& literal) {
  std::vector<std::uint64_t> shape;
  literal.expect('(');
  literal.elements(')', [&] {
    if (shape.size() == 2) throw UnsupportedFormat("the NumPy array has more than two dimensions");
    shape.push_back(literal.integer());
  });
  return shape;
}

/// Sets up the columns of an array of plain numbers.
void make_columns(const Type& type, bool is_fortran, const std::vector<std::uint64_t>& shape,
                  NpyHeader& header) {
  constexpr std::uint64_t max_columns = 16;
  // Rows with an index or labels have up to six columns.
  const bool is_transposed = shape.size() == 2 && shape[0] >= event_columns &&
                             shape[0] <= max_columns &&
                             shape[1] > (shape[0] == event_columns ? all_columns : max_columns);
  if (is_transposed) header.count = shape[1];
  const auto count = shape.size() < 2 ? 1 : shape[is_transposed ? 0 : 1];
  if (count == 0 || count > max_columns)
    throw UnsupportedFormat("the NumPy array must have the shape (N, 4) or (4, N)");
  header.by_columns = is_fortran != is_transposed && count > 1 && header.count > 1;
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto field = number_of(type, header.element_bytes);
    if (!field) throw UnsupportedFormat("the NumPy array is not of numbers of 8 to 64 bits");
    header.columns.push_back(*field);
    header.element_bytes += type.bytes;
  }
}

}  // namespace

NpyHeader read_npy_header(std::string_view dictionary) {
  NpyHeader header;
  std::optional<Type> type;
  bool has_fields = false;
  bool is_fortran = false;
  std::optional<std::vector<std::uint64_t>> shape;
  Literal literal(dictionary);
  literal.expect('{');
  literal.elements('}', [&] {
    const auto key = literal.string();
    literal.expect(':');
    if (key == "descr" && !has_fields && !type) {
      has_fields = !literal.starts_with_string();
      if (has_fields)
        read_fields(literal, header);
      else
        type = read_type(literal.string());
    } else if (key == "fortran_order") {
      is_fortran = literal.boolean();
    } else if (key == "shape" && !shape) {
      shape = read_shape(literal);
    } else {
      Literal::fail();
    }
  });
  literal.expect_end();
  if ((!has_fields && !type) || !shape) Literal::fail();
  if (has_fields && shape->size() != 1)
    throw UnsupportedFormat("the NumPy array must have one dimension");
  header.count = shape->empty() ? 1 : shape->front();
  if (type) make_columns(*type, is_fortran, *shape, header);
  return header;
}

std::string npy_preamble(std::string_view dictionary) {
  constexpr std::size_t before = npy_magic.size() + 4;
  constexpr std::size_t alignment = 64;  // of the data, as by NumPy
  const auto size = (before + dictionary.size()) / alignment * alignment + alignment;
  std::string text(npy_magic);
  text +=
      {'\x01', '\x00', static_cast<char>(size - before), static_cast<char>((size - before) >> 8)};
  text += dictionary;
  text.resize(size - 1, ' ');
  text += '\n';
  return text;
}

std::optional<NpyHeader> NpyPreamble::read(std::span<const std::uint8_t>& bytes) {
  constexpr std::size_t max_header = 65536;
  constexpr std::size_t version_end = npy_magic.size() + 2;
  if (read_.empty() && bytes.empty()) return std::nullopt;
  // Bytes needed to determine the next size.
  std::size_t needed = version_end;
  const auto collect = [&] {
    if (needed > read_.size()) {
      const auto count = std::min(needed - read_.size(), bytes.size());
      read_.insert(read_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
      bytes = bytes.subspan(count);
    }
    return read_.size() >= needed;
  };
  const bool long_enough = collect();
  const auto known = std::min(read_.size(), npy_magic.size());
  if (std::memcmp(read_.data(), npy_magic.data(), known) != 0)
    throw UnsupportedFormat("not a NumPy file");
  if (!long_enough) return std::nullopt;
  const int version = read_[npy_magic.size()];
  if (version < 1 || version > 3)
    throw UnsupportedFormat("unsupported NumPy version " + std::to_string(version));
  needed += version == 1 ? 2 : 4;
  if (!collect()) return std::nullopt;
  const std::size_t length = version == 1
                                 ? little_endian<std::uint16_t>(read_.data() + version_end)
                                 : little_endian<std::uint32_t>(read_.data() + version_end);
  const auto header_begin = needed;
  if (length > max_header) throw UnsupportedFormat("NumPy header too long");
  needed += length;
  if (!collect()) return std::nullopt;
  return read_npy_header({reinterpret_cast<const char*>(read_.data()) + header_begin, length});
}

}  // namespace eventcamera
