// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace eventcamera {

/// Decimal number of a text, multiplied by a power of ten.
struct Decimal {
  std::int64_t value;  ///< rounded down
  bool whole;          ///< no digits were cut off
  bool has_fraction;   ///< it has a decimal point or an exponent
};

/// Parses `text`, such as -12, 3.25 or 1e-6, multiplied by 10^`power`, without floating-point
/// arithmetic. Nothing if it is not entirely a number, or out of range.
///
/// Programs print 3e-6, stored as a double, as 2.999999999999999924e-06. So a number that a double
/// cannot distinguish from the integer above it, within 0.0005, is that integer.
std::optional<Decimal> read_decimal(std::string_view text, int power);

}  // namespace eventcamera
