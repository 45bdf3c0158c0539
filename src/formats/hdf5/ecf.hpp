// SPDX-License-Identifier: LGPL-2.1-or-later
// ECF, the compression of Metavision HDF5 files: encodes a chunk of events as runs of equal times,
// rows and polarities.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/core/event.hpp"

namespace eventcamera {

/// HDF5 ID of the filter.
constexpr int ecf_filter = 0x8ecf;

constexpr std::size_t ecf_max_events = 65535;
constexpr int ecf_max_pixels = 2048;  ///< per row or column

/// Upper bound for the size of a chunk with this many events: a time takes at most 17 bytes, x, y
/// and p take 7, and groups of 4 are padded.
constexpr std::size_t ecf_max_bytes(std::size_t events) {
  return 32 + 24 * events;
}

/// Appends a chunk with `events` to `out`: at most ecf_max_events, sorted, within ecf_max_pixels.
void encode_ecf(std::span<const AbsoluteEvent> events, std::vector<std::uint8_t>& out);

/// Appends the events of a chunk to `out`. Returns false and appends nothing if it is corrupt.
bool decode_ecf(std::span<const std::uint8_t> chunk, std::vector<AbsoluteEvent>& out);

/// Time of the first event of a chunk; nothing if the chunk is too short.
std::optional<Microseconds> ecf_first_time(std::span<const std::uint8_t> chunk);

}  // namespace eventcamera
