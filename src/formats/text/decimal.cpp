// SPDX-License-Identifier: LGPL-2.1-or-later
#include "src/formats/text/csv_decoder.hpp"

#include <algorithm>
#include <limits>

#include "src/formats/event_table.hpp"

namespace eventcamera {

namespace {

constexpr bool is_digit(char letter) {
  return letter >= '0' && letter <= '9';
}

/// Parses digits, saturating at a limit that no valid exponent reaches.
int read_exponent(std::string_view digits) {
  int number = 0;
  for (const auto digit : digits) number = std::min(number * 10 + (digit - '0'), 100'000);
  return number;
}

/// digits * 10^power, as a text has it.
struct Number {
  bool negative = false;
  std::uint64_t digits = 0;
  int power = 0;
  bool whole = true;  ///< no digits were cut off
  bool has_fraction = false;
};

/// Nothing if the text is not entirely a number.
std::optional<Number> parsed(std::string_view text) {
  std::size_t at = 0;
  const auto more = [&] { return at < text.size(); };
  const auto read_sign = [&] {
    const bool is_sign = more() && (text[at] == '-' || text[at] == '+');
    return is_sign && text[at++] == '-';
  };
  Number number{.negative = read_sign()};
  // Up to 19 digits are exact in 64 bits.
  constexpr auto room = std::numeric_limits<std::uint64_t>::max() / 10 - 1;
  bool any = false;
  for (; more(); ++at) {
    if (text[at] == '.' && !number.has_fraction) {
      number.has_fraction = true;
      continue;
    }
    if (!is_digit(text[at])) break;
    any = true;
    if (number.digits <= room) {
      number.digits = number.digits * 10 + static_cast<std::uint64_t>(text[at] - '0');
      number.power -= number.has_fraction ? 1 : 0;
    } else {
      number.whole = number.whole && text[at] == '0';
      number.power += number.has_fraction ? 0 : 1;
    }
  }
  if (!any) return std::nullopt;
  if (more() && (text[at] == 'e' || text[at] == 'E')) {
    ++at;
    number.has_fraction = true;
    const bool down = read_sign();
    const auto rest = text.substr(at);
    if (rest.empty() || !std::ranges::all_of(rest, is_digit)) return std::nullopt;
    number.power += down ? -read_exponent(rest) : read_exponent(rest);
    at = text.size();
  }
  if (more()) return std::nullopt;
  return number;
}

/// Nothing if the number is out of range.
std::optional<Decimal> rounded_down(const Number& number) {
  auto [negative, digits, power, whole, has_fraction] = number;
  constexpr auto max = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
  for (; power > 0 && digits != 0; --power) {
    if (digits > max / 10) return std::nullopt;
    digits *= 10;
  }
  // Cuts off digits: the fraction is rest / scale.
  auto rest = 0.0;
  auto scale = 1.0;
  for (; power < 0 && digits != 0; ++power, scale *= 10) {
    rest += static_cast<double>(digits % 10) * scale;
    digits /= 10;
  }
  whole = whole && rest == 0;
  if (digits >= max && !whole) return std::nullopt;
  if (digits > max) return std::nullopt;
  const double rounding_up = has_fraction ? max_rounding_up * scale : 0;
  const bool up = negative ? !whole && rest > rounding_up : scale - rest <= rounding_up;
  const auto value = static_cast<std::int64_t>(digits + (up ? 1 : 0));
  return Decimal{negative ? -value : value, whole, has_fraction};
}

}  // namespace

std::optional<Decimal> read_decimal(std::string_view text, int power) {
  auto number = parsed(text);
  if (!number) return std::nullopt;
  number->power += power;
  return rounded_down(*number);
}

}  // namespace eventcamera
