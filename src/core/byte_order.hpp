// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <bit>
#include <concepts>
#include <cstdint>
#include <cstring>

#include "src/core/event.hpp"

namespace eventcamera {

/// Reads a little-endian number at any alignment.
template <class Number>
Number little_endian(const std::uint8_t* bytes) {
  Number number;
  std::memcpy(&number, bytes, sizeof number);
  return number;
}

/// Writes a little-endian number at any alignment.
template <class Number>
void put_little_endian(Number number, std::uint8_t* bytes) {
  std::memcpy(bytes, &number, sizeof number);
}

/// Converts a number between little-endian, the host's byte order, and `order`.
template <std::unsigned_integral Number>
constexpr Number in_order(Number number, std::endian order) {
  if (order == std::endian::little) return number;
  Number swapped = 0;
  for (std::size_t i = 0; i < sizeof number; ++i)
    swapped = static_cast<Number>(swapped << 8 | (number >> 8 * i & 0xff));
  return swapped;
}

/// Reads a number in any order, at any alignment.
template <std::unsigned_integral Number>
Number load(const std::uint8_t* bytes, std::endian order) {
  return in_order(little_endian<Number>(bytes), order);
}

/// Writes a number in any order, at any alignment.
template <std::unsigned_integral Number>
void store(Number number, std::uint8_t* bytes, std::endian order) {
  put_little_endian(in_order(number, order), bytes);
}

}  // namespace eventcamera
