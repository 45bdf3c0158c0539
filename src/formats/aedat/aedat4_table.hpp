// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"

namespace eventcamera {

/// Entry for one packet in the table at the end of an AEDAT4 file.
struct Aedat4TableEntry {
  std::uint64_t position;  ///< of the packet header in the file
  int stream;              ///< stream ID
  int size;                ///< payload size
  std::int64_t elements;
  Microseconds start;  ///< time of its first element
  Microseconds end;    ///< time of its last element

  friend constexpr bool operator==(const Aedat4TableEntry&, const Aedat4TableEntry&) = default;
};

/// Parses the table in `bytes`, the end of the file from the table's position on; nothing if they
/// are not a table. The first packet is at `packets_at`. Positions point to packets or to their
/// payloads, depending on the writer; the first entry shows which.
std::optional<std::vector<Aedat4TableEntry>> read_aedat4_table(std::span<const std::uint8_t> bytes,
                                                               Aedat4Compression compression,
                                                               std::uint64_t packets_at);

/// Returns the position from which to read everything at `t` or later; nothing if there is none.
std::optional<std::uint64_t> aedat4_position_of(std::span<const Aedat4TableEntry> table,
                                                Microseconds t);

/// Serializes the table, before compression.
std::vector<std::uint8_t> aedat4_table_content(std::span<const Aedat4TableEntry> table);

}  // namespace eventcamera
