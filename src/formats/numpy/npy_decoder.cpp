// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/numpy/npy_decoder.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "src/formats/little_endian.hpp"

namespace eventcamera {

namespace {

constexpr std::size_t max_header = 65536;

double half_of(std::uint16_t bits) {
  const int exponent = bits >> 10 & 31;
  const int mantissa = bits & 1023;
  const double magnitude = exponent == 0    ? std::ldexp(mantissa, -24)
                           : exponent == 31 ? std::numeric_limits<double>::infinity()
                                            : std::ldexp(mantissa + 1024, exponent - 25);
  return (bits & 0x8000) != 0 ? -magnitude : magnitude;
}

/// The number that a field has, rounded to the nearest after a floating-point one is multiplied;
/// nothing where 64 bits do not hold it.
std::optional<std::int64_t> number_of(const NpyField& field, const std::uint8_t* element,
                                      double factor) {
  std::uint64_t word = 0;
  std::memcpy(&word, element + field.offset, field.bytes);
  if (field.big_endian) word = __builtin_bswap64(word) >> (64 - 8 * field.bytes);
  const unsigned unused = 64 - 8 * field.bytes;
  switch (field.kind) {
    case NpyField::Kind::signed_integer:
      return static_cast<std::int64_t>(word << unused) >> unused;
    case NpyField::Kind::unsigned_integer:
    case NpyField::Kind::boolean:
      if (word > std::numeric_limits<std::int64_t>::max()) return std::nullopt;
      return static_cast<std::int64_t>(word);
    case NpyField::Kind::floating:
      break;
  }
  double number = 0;
  if (field.bytes == 8) {
    number = std::bit_cast<double>(word);
  } else if (field.bytes == 4) {
    number = std::bit_cast<float>(static_cast<std::uint32_t>(word));
  } else {
    number = half_of(static_cast<std::uint16_t>(word));
  }
  number = std::round(number * factor);
  if (!(std::abs(number) < 0x1p63)) return std::nullopt;  // nor where it is no number
  return static_cast<std::int64_t>(number);
}

/// How to take a little-endian integer out of 8 bytes that lie within the element.
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

}  // namespace

bool NpyDecoder::take_header(std::span<const std::uint8_t>& bytes) {
  constexpr std::size_t version_end = npy_magic.size() + 2;
  // As many bytes as are needed to know how many are needed.
  std::size_t needed = version_end;
  const auto take = [&] {
    if (needed > rest_.size()) {
      const auto count = std::min(needed - rest_.size(), bytes.size());
      rest_.insert(rest_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
      bytes = bytes.subspan(count);
    }
    return rest_.size() >= needed;
  };
  const bool long_enough = take();
  const auto known = std::min(rest_.size(), npy_magic.size());
  if (std::memcmp(rest_.data(), npy_magic.data(), known) != 0)
    throw UnsupportedFormat("not a NumPy file");
  if (!long_enough) return false;
  const int version = rest_[npy_magic.size()];
  if (version < 1 || version > 3)
    throw UnsupportedFormat("unsupported NumPy version " + std::to_string(version));
  needed += version == 1 ? 2 : 4;
  if (!take()) return false;
  const std::size_t length = version == 1
                                 ? little_endian<std::uint16_t>(rest_.data() + version_end)
                                 : little_endian<std::uint32_t>(rest_.data() + version_end);
  const auto header_begin = needed;
  if (length > max_header) throw UnsupportedFormat("NumPy header too long");
  needed += length;
  if (!take()) return false;

  header_ = read_npy_header({reinterpret_cast<const char*>(rest_.data()) + header_begin, length});
  plain_ = header_.element_bytes >= sizeof(std::uint64_t) &&
           std::ranges::all_of(header_.fields, [](const NpyField& field) {
             // Of 64 bits without a sign not all fit.
             return field.kind != NpyField::Kind::floating &&
                    (!field.big_endian || field.bytes == 1) &&
                    (field.kind == NpyField::Kind::signed_integer || field.bytes < 8);
           });
  left_ = header_.count;
  position_ = rest_.size();
  rest_.clear();
  header_read_ = true;
  return true;
}

void NpyDecoder::decode(std::span<const std::uint8_t> bytes, Decoded& out) {
  if (bytes.empty() || (!header_read_ && !take_header(bytes))) return;
  const std::size_t size = header_.element_bytes;
  if (!rest_.empty()) {
    const auto count = std::min(size - rest_.size(), bytes.size());
    rest_.insert(rest_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
    bytes = bytes.subspan(count);
    if (rest_.size() < size) return;
    read_elements(rest_.data(), 1, out);
    rest_.clear();
  }
  const auto count = std::min<std::uint64_t>(bytes.size() / size, left_);
  read_elements(bytes.data(), count, out);
  bytes = bytes.subspan(count * size);
  if (left_ > 0) {
    rest_.assign(bytes.begin(), bytes.end());
  } else if (!bytes.empty() && !after_end_) {
    corruption_.note(position_, "bytes after the last event of the NumPy array");
    after_end_ = true;
  }
}

void NpyDecoder::finish(Decoded& /*out*/) {
  if (!header_read_) throw UnsupportedFormat("truncated NumPy header");
  if (!rest_.empty()) {
    corruption_.note(position_, "truncated last event");
  } else if (left_ > 0 && header_.count != npy_unknown_count) {
    corruption_.note(position_, "fewer events than the NumPy header says");
  }
}

void NpyDecoder::read_elements(const std::uint8_t* bytes, std::uint64_t count, Decoded& out) {
  const auto size = header_.element_bytes;
  const auto* const end = bytes + count * size;
  left_ -= count;
  const auto field = [&](EventColumn column) -> const NpyField& {
    return header_.fields[static_cast<std::size_t>(column)];
  };
  const auto& t_field = field(EventColumn::t);
  const auto& x_field = field(EventColumn::x);
  const auto& y_field = field(EventColumn::y);
  const auto& p_field = field(EventColumn::p);
  if (plain_) {
    const Window t(t_field, size), x(x_field, size), y(y_field, size), p(p_field, size);
    for (; bytes < end; bytes += size, position_ += size)
      validator_.take(t.read(bytes), x.read(bytes), y.read(bytes), p.read(bytes) > 0, out.events,
                      corruption_);
    return;
  }
  const double microseconds = t_field.kind == NpyField::Kind::floating ? 1e6 : 1;
  for (; bytes < end; bytes += size, position_ += size) {
    const auto t = number_of(t_field, bytes, microseconds);
    const auto x = number_of(x_field, bytes, 1);
    const auto y = number_of(y_field, bytes, 1);
    const auto p = number_of(p_field, bytes, 1);
    if (t && x && y && p) {
      validator_.take(*t, *x, *y, *p > 0, out.events, corruption_);
    } else {
      corruption_.note(position_, "number out of range");
    }
  }
}

}  // namespace eventcamera
