// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace eventcamera {

/// Decimal number of a text, multiplied by a power of ten.
struct Decimal {
  std::int64_t value;  ///< rounded down, or up to the integer close above
  bool whole;          ///< no digits were cut off
  bool has_fraction;   ///< it has a decimal point or an exponent
};

/// Parses `text`, such as -12, 3.25 or 1e-6, multiplied by 10^`power`, without floating-point
/// arithmetic. Nothing if it is not entirely a number, or out of range.
///
/// Numbers with a fraction are rounded up by at most `max_rounding_up`.
std::optional<Decimal> read_decimal(std::string_view text, int power);

}  // namespace eventcamera
