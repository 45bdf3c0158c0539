// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "src/formats/aedat/aedat4.hpp"

namespace eventcamera {

/// What the table at an AEDAT4 file's end says of one packet.
struct Aedat4TableEntry {
  std::uint64_t position;  ///< in the file, of the packet's header
  int stream;              ///< its id
  int size;                ///< of the payload
  std::int64_t elements;
  Microseconds start;  ///< of its first element
  Microseconds end;    ///< of its last

  friend constexpr bool operator==(const Aedat4TableEntry&, const Aedat4TableEntry&) = default;
};

/// The table in `bytes`, which are what the file has from its table's position to its end; nothing
/// where they are no table. Packets begin at `packets_at`: files differ in whether they give the
/// position of a packet or of its payload, and the first tells which it is.
std::optional<std::vector<Aedat4TableEntry>> read_aedat4_table(std::span<const std::uint8_t> bytes,
                                                               Aedat4Compression compression,
                                                               std::uint64_t packets_at);

/// Where to read from to have everything that is not before `t`; nothing where all of it is.
std::optional<std::uint64_t> aedat4_position_of(std::span<const Aedat4TableEntry> table,
                                                Microseconds t);

/// The table's content, as it is before compression.
std::vector<std::uint8_t> aedat4_table_content(std::span<const Aedat4TableEntry> table);

}  // namespace eventcamera
