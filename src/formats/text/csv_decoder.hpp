// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "src/formats/decoder.hpp"
#include "src/formats/event_table.hpp"

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

/// Decodes lines of text, in UTF-8 or, with a byte order mark, UTF-16. Fields are separated by
/// commas, semicolons or blanks, and may be quoted; lines starting with # or % are comments; empty
/// lines are ignored. Between semicolons, blanks or quotes, numbers may have decimal commas or
/// commas before thousands.
///
/// Properties not given in the settings are detected from the header and the first 256 lines:
/// - the columns, by a line of names, which may include labels, cause and class, and
///   further columns that are ignored, by names in a comment, or by the numbers (TableSample);
/// - the time unit, by the name of its column or by the numbers. Integer times in blank-separated
///   columns without names may be microseconds (DVS-Voltmeter) or nanoseconds (rpg_esim); an
///   ambiguous file is refused. Times are rounded as by read_decimal();
/// - the sensor size, by %geometry:W,H, by names such as x@W and y@H, or by a first line W H.
///
/// Polarity is 0/1, -1/1, 1/2 (PolarityCode), or in words: false/true, OFF/ON, neg/pos.
///
/// A table in which more than one line in a hundred is not an event is refused.
///
/// A file with only a header or comments, or with nothing, is a recording without events.
std::unique_ptr<EventDecoder> make_csv_decoder(const TableSettings& settings = {});

/// True for the start of a text whose columns have names, or several lines of which are events
/// without exception. Ambiguous time units and events outside a sensor do not matter here; they are
/// reported when the file is read.
bool is_csv(std::span<const std::uint8_t> start);

}  // namespace eventcamera
