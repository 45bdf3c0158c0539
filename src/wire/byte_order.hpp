// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <bit>
#include <concepts>
#include <cstdint>
#include <cstring>

namespace eventcamera {

/// Converts a number between the host's byte order and `order`.
template <std::unsigned_integral Number>
constexpr Number in_order(Number number, std::endian order) {
  if (order == std::endian::native) return number;
  Number swapped = 0;
  for (std::size_t i = 0; i < sizeof number; ++i)
    swapped = static_cast<Number>(swapped << 8 | (number >> 8 * i & 0xff));
  return swapped;
}

/// Reads a number at any alignment.
template <std::unsigned_integral Number>
Number load(const std::uint8_t* bytes, std::endian order) {
  Number number;
  std::memcpy(&number, bytes, sizeof number);
  return in_order(number, order);
}

/// Writes a number at any alignment.
template <std::unsigned_integral Number>
void store(Number number, std::uint8_t* bytes, std::endian order) {
  number = in_order(number, order);
  std::memcpy(bytes, &number, sizeof number);
}

}  // namespace eventcamera
