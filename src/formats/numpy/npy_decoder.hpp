// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "src/formats/decoder.hpp"
#include "src/formats/event_table.hpp"
#include "src/formats/numpy/npy_header.hpp"

namespace eventcamera {

/// Decodes NumPy files, versions 1.0 to 3.0: a structured array with fields t, x, y and p in any
/// order, or rows of numbers whose columns are detected from the first rows. Numbers are integers
/// or floating-point numbers of any width and byte order. The time unit is taken from the name of
/// the field, or detected from the first rows (TableSample). An array in which more than one row in
/// a hundred is not an event is refused.
std::unique_ptr<EventDecoder> make_npy_decoder(const TableSettings& settings = {});

/// Reads only elements, as described by `header`. Throws UnsupportedFormat if their columns cannot
/// be events.
std::unique_ptr<EventDecoder> make_npy_decoder(const NpyHeader& header,
                                               const TableSettings& settings);

/// Returns a number, rounded as times are; nothing if it exceeds 64 bits.
std::optional<std::int64_t> npy_integer(const NpyField& field, const std::uint8_t* element);

}  // namespace eventcamera
