// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "src/core/byte_order.hpp"

namespace eventcamera {

/// Reads little-endian fields one after the other. Past the end everything is 0 or empty, and
/// failed() is true.
class ByteCursor {
 public:
  explicit ByteCursor(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  bool failed() const { return failed_; }

  std::size_t position() const { return position_; }

  std::span<const std::uint8_t> rest() const { return bytes_.subspan(position_); }

  template <class Number>
  Number number() {
    const auto field = bytes(sizeof(Number));
    return field.empty() ? Number{} : little_endian<Number>(field.data());
  }

  std::span<const std::uint8_t> bytes(std::uint64_t count) {
    if (failed_ || count > bytes_.size() - position_) {
      failed_ = true;
      return {};
    }
    const auto field = bytes_.subspan(position_, static_cast<std::size_t>(count));
    position_ += field.size();
    return field;
  }

  /// Bytes preceded by their number.
  template <class Size>
  std::span<const std::uint8_t> sized_bytes() {
    return bytes(number<Size>());
  }

  /// Text preceded by its size, 32 bits.
  std::string_view text() {
    const auto field = sized_bytes<std::uint32_t>();
    return {reinterpret_cast<const char*>(field.data()), field.size()};
  }

  /// Goes to the next multiple of `alignment`, a power of two.
  void align(std::size_t alignment) { bytes((alignment - position_ % alignment) % alignment); }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t position_ = 0;
  bool failed_ = false;
};

/// Appends little-endian fields, which ByteCursor reads.
class ByteAppender {
 public:
  explicit ByteAppender(std::vector<std::uint8_t>& out) : out_(out) {}

  template <class Number>
  void put(Number number) {
    const auto at = out_.size();
    out_.resize(at + sizeof number);
    put_little_endian(number, out_.data() + at);
  }

  /// Text after its size, 32 bits.
  void put(std::string_view text) {
    put(static_cast<std::uint32_t>(text.size()));
    out_.insert(out_.end(), text.begin(), text.end());
  }

  template <class First, class Second, class... More>
  void put(First first, Second second, More... more) {
    put(first);
    put(second, more...);
  }

  /// Appends zeros up to a multiple of `alignment` after `start`.
  void align(std::size_t start, std::size_t alignment) {
    while ((out_.size() - start) % alignment != 0) out_.push_back(0);
  }

 private:
  std::vector<std::uint8_t>& out_;
};

}  // namespace eventcamera
