// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "src/core/event.hpp"
#include "src/formats/compression/compressed_frames.hpp"
#include "src/formats/decoder.hpp"

namespace eventcamera {

/// Compression of the packets of an AEDAT4 file; the values are those in the file.
enum class Aedat4Compression : std::uint8_t {
  none = 0,
  lz4 = 1,
  lz4_high = 2,
  zstd = 3,
  zstd_high = 4,
};

/// Codec of compressed packets; `compression` must not be `none`.
constexpr FrameCodec codec_of(Aedat4Compression compression) {
  const bool is_lz4 =
      compression == Aedat4Compression::lz4 || compression == Aedat4Compression::lz4_high;
  return is_lz4 ? FrameCodec::lz4 : FrameCodec::zstd;
}

/// First line of the file.
constexpr std::string_view aedat4_magic = "#!AER-DAT4.0\r\n";

/// Meaning of a trigger's source, a number in the file: input and direction of the edge.
struct Aedat4Edge {
  std::uint16_t id;
  bool rising;

  friend constexpr bool operator==(const Aedat4Edge&, const Aedat4Edge&) = default;
};
inline constexpr std::array<Aedat4Edge, 10> aedat4_edges{{{4, true},
                                                          {0, true},
                                                          {0, false},
                                                          {5, true},
                                                          {1, true},
                                                          {1, false},
                                                          {2, true},
                                                          {2, false},
                                                          {3, true},
                                                          {3, false}}};

/// Size of the packet header: stream ID and payload size.
constexpr std::size_t aedat4_packet_header = 8;

/// Size limit of payloads, compressed and decompressed. An uncompressed colour frame of 4096x2304
/// pixels fits.
constexpr std::size_t aedat4_max_packet = std::size_t{64} << 20;

/// Times beyond this, in either direction, are corrupt: 36,000 years.
constexpr Microseconds aedat4_last_time = Microseconds{1} << 60;

/// Content of the XML in an AEDAT4 header.
struct Aedat4InfoNode {
  std::vector<StreamInfo> streams;
  bool whole = true;  ///< false: the XML is corrupt, and `streams` is incomplete
};

Aedat4InfoNode read_info_node(std::string_view xml);

std::string write_info_node(std::span<const StreamInfo> streams, Aedat4Compression compression);

/// Kind of streams whose packets have this four-character identifier.
StreamKind aedat4_kind(std::string_view identifier);

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
