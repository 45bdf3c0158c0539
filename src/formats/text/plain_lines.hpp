// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "src/core/event.hpp"
#include "src/formats/event_table.hpp"

namespace eventcamera {

/// Reads typical lines of events fast: numbers without sign (except for the polarity), one
/// separator, no blanks.
class PlainLines {
 public:
  /// Maximum number of characters that read() examines.
  static constexpr std::ptrdiff_t reach = 128;

  struct Row {
    Microseconds t;
    std::int64_t x, y;
    bool on;
  };

  /// `columns` are t, x, y and p in any order. The time unit is 10^`power`
  /// microseconds.
  PlainLines(const Columns& columns, char separator, int power)
      : separator_(separator), power_(power) {
    std::ranges::transform(columns, columns_.begin(), [](const auto& column) { return *column; });
  }

  /// Returns the start of the next line, or nullptr if the line is not such a line.
  const char* read(const char* at, Row& row) const {
    std::array<std::uint64_t, event_columns> values;
    for (const auto& column : columns_) {
      auto& value = values[static_cast<std::size_t>(column)];
      if (column == EventColumn::p) {
        const bool minus = *at == '-';
        at += minus ? 1 : 0;
        const auto digit = static_cast<unsigned char>(*at++ - '0');
        if (digit > 1) return nullptr;
        value = minus ? 0 : digit;
      } else if (!read_integer(at, value) ||
                 (column == EventColumn::t && !read_microseconds(at, value))) {
        return nullptr;
      }
      if (&column != &columns_.back() && *at++ != separator_) return nullptr;
    }
    if (*at == '\r') ++at;
    if (*at++ != '\n') return nullptr;

    const auto number = [&](EventColumn column) {
      return static_cast<std::int64_t>(values[static_cast<std::size_t>(column)]);
    };
    row = {number(EventColumn::t), number(EventColumn::x), number(EventColumn::y),
           number(EventColumn::p) == 1};
    return at;
  }

 private:
  static constexpr std::uint64_t powers_of_ten[] = {
      1, 10, 100, 1'000, 10'000, 100'000, 1'000'000, 10'000'000, 100'000'000};

  /// Digits at the front of eight characters, and their value.
  struct Digits {
    unsigned count;
    std::uint64_t value;
  };

  static Digits read_digits(const char* at) {
    std::uint64_t word;
    std::memcpy(&word, at, sizeof word);
    word ^= 0x3030303030303030;
    // Non-digits are now above 9 and set the highest bit of their byte. Carries only affect later
    // bytes, and only the first non-digit counts.
    const auto others = ((word + 0x7676767676767676) | word) & 0x8080808080808080;
    const auto count = static_cast<unsigned>(std::countr_zero(others)) / 8;
    if (count == 0) return {0, 0};
    word <<= 64 - 8 * count;  // moves the last digit to the last byte, with zeros before the first
    // Combine neighbours to numbers of two, four and eight digits.
    word = word * 10 + (word >> 8);
    word = ((word & 0x000000ff000000ff) * 0x000f424000000064 +
            ((word >> 16) & 0x000000ff000000ff) * 0x0000271000000001) >>
           32;
    return {count, word};
  }

  /// Reads up to 16 digits; false if there are none, or more.
  static bool read_integer(const char*& at, std::uint64_t& value) {
    const auto digits = read_digits(at);
    at += digits.count;
    value = digits.value;
    if (digits.count < 8) return digits.count > 0;
    const auto more = read_digits(at);
    at += more.count;
    value = value * powers_of_ten[more.count] + more.value;
    return more.count < 8;
  }

  /// Converts the integer of a time to microseconds, and adds its decimals if it is in seconds;
  /// false if that may be inexact.
  bool read_microseconds(const char*& at, std::uint64_t& value) const {
    constexpr std::uint64_t max_value = 1'000'000'000'000;
    if (power_ == 6) {
      if (value > max_value) return false;
      value *= 1'000'000;
      if (*at != '.') return true;
      ++at;
      const auto digits = read_digits(at);
      at += digits.count;
      if (digits.count == 8) at += read_digits(at).count;
      const auto fraction = digits.value * powers_of_ten[8 - digits.count];
      value += (fraction + static_cast<std::uint64_t>(100 * max_rounding_up)) / 100;
    } else if (power_ == 3) {
      if (value > max_value) return false;
      value *= 1000;
    } else if (power_ == -3) {
      value /= 1000;
    }
    return true;
  }

  std::array<EventColumn, event_columns> columns_;
  char separator_;
  int power_;
};

}  // namespace eventcamera
