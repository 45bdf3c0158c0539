// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "src/core/byte_order.hpp"

namespace eventcamera {

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

  /// Appends zeros up to a multiple of `alignment` after `start`.
  void align(std::size_t start, std::size_t alignment) {
    while ((out_.size() - start) % alignment != 0) out_.push_back(0);
  }

 private:
  std::vector<std::uint8_t>& out_;
};

}  // namespace eventcamera
