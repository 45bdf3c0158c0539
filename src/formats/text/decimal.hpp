// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace eventcamera {

/// A decimal number of a text, times a power of ten.
struct Decimal {
  std::int64_t value;  ///< rounded to the nearest
  bool whole;          ///< nothing was rounded off
  bool has_fraction;   ///< it has a decimal point or an exponent
};

/// Reads `text`, such as -12, 3.25 or 1e-6, times 10^`power`, without floating point. Nothing where
/// it is not a number from end to end, or does not fit.
std::optional<Decimal> read_decimal(std::string_view text, int power);

}  // namespace eventcamera
