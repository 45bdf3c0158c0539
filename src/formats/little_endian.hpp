// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

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

}  // namespace eventcamera
