// SPDX-License-Identifier: LGPL-2.1-or-later
// ECF, the compression of Metavision's HDF5 files: a chunk of events as runs of equal times, rows
// and polarities.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"

namespace eventcamera {

/// HDF5's number of the filter.
constexpr int ecf_filter = 0x8ecf;

constexpr std::size_t ecf_most_events = 65535;
constexpr int ecf_most_pixels = 2048;  ///< in a row or column

/// More bytes than a chunk of so many events can have: a time takes 17 of them at most, x, y and p
/// 7, and groups of 4 are filled up.
constexpr std::size_t ecf_most_bytes(std::size_t events) {
  return 32 + 24 * events;
}

/// Appends a chunk to `out`: at most ecf_most_events events, sorted, within ecf_most_pixels.
void encode_ecf(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out);

/// Appends the events of a chunk to `out`. False, and nothing is appended, where it is corrupt.
bool decode_ecf(std::span<const std::uint8_t> chunk, std::vector<AbsoluteEvent>& out);

/// The time of a chunk's first event; nothing where the chunk is too short.
std::optional<Microseconds> ecf_first_time(std::span<const std::uint8_t> chunk);

}  // namespace eventcamera
